'use strict';
/* Columns of numbers, as data.py packs them. */

// Marks a missing number.
const MISSING = -(2 ** 31);

/** Return a column as numbers; NaN where there is none. */
function unpacked(column) {
  const bytes = decoded(column.data);
  if (column.kind === 'f32') return new Float32Array(bytes.buffer);
  const counts = new Int32Array(bytes.buffer);
  return Float64Array.from(counts, (count) => (count === MISSING ? NaN : count * column.scale));
}

function decoded(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i += 1) bytes[i] = text.charCodeAt(i);
  return bytes;
}
