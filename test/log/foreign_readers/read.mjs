// Read an MCAP file by its index, as Foxglove and Lichtblick do, and decode all of its messages.
// Prints for each topic how many there are, and the times, numbers and data of all messages, which are Float64.
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { readFile } from "node:fs/promises";

const file = await readFile(process.argv[2]);
const reader = await McapIndexedReader.Initialize({
  readable: {
    size: async () => BigInt(file.length),
    read: async (offset, length) => file.subarray(Number(offset), Number(offset + length)),
  },
  decompressHandlers: await loadDecompressHandlers(),
});
const decoders = new Map();
const found = { topics: {}, values: [], metadata: [], attachments: [] };
for (const channel of reader.channelsById.values()) {
  const schema = reader.schemasById.get(channel.schemaId);
  const definition = parse(new TextDecoder().decode(schema.data), { ros2: true });
  decoders.set(channel.id, new MessageReader(definition));
  found.topics[channel.topic] = 0;
}
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const decoded = decoders.get(channel.id).readMessage(message.data);
  found.topics[channel.topic] += 1;
  found.values.push([String(message.logTime), message.sequence, decoded.data]);
}
for await (const record of reader.readMetadata()) found.metadata.push(record.name);
for await (const record of reader.readAttachments()) found.attachments.push(record.name);
console.log(JSON.stringify(found));
