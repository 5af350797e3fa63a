'use strict';
/*
 * The socket: one frame at a time, acknowledged when it is drawn, so that the next one is under way
 * meanwhile. A frame that is not drawn is not acknowledged, so nothing is queued on either side.
 */

// Keep-alive period while the page drives [ms]; view_node releases the drive after 350.
const BEAT = 100;
const RETRY = [500, 1000, 2000, 4000];

class Connection {
  /** `draw` receives each frame, `changed` whether there is a connection. */
  constructor(draw, changed) {
    this.draw = draw;
    this.changed = changed;
    this.number = 0;
    this.waiting = new Map();
    this.failures = 0;
    this.drives = false;
    setInterval(() => this.drives && this.send({}), BEAT);
    addEventListener('pagehide', () => this.socket && this.socket.close());
    this.open();
  }

  open() {
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    const socket = new WebSocket(`${scheme}://${location.host}/socket${location.search}`);
    this.socket = socket;
    this.frame = null;
    socket.addEventListener('message', (event) => this.receive(socket, event.data));
    socket.addEventListener('close', (event) => this.close(socket, event));
  }

  /** Receive a frame; one without poses is processed at once, as the next one has the pose. */
  receive(socket, text) {
    const frame = JSON.parse(text);
    if (frame.poses) requestAnimationFrame(() => this.take(socket, frame));
    else this.take(socket, frame);
  }

  take(socket, frame) {
    if (socket !== this.socket || socket.readyState !== WebSocket.OPEN) return;
    if (frame.n === 1) this.changed(true, '');
    this.failures = 0;
    this.send({ ack: frame.n });
    for (const answer of frame.answers || []) this.answered(answer);
    this.draw(frame);
  }

  close(socket, event) {
    if (socket !== this.socket) return;
    for (const resolve of this.waiting.values()) resolve({ done: false, message: 'the connection is lost' });
    this.waiting.clear();
    this.drives = false;
    this.changed(false, event.reason);
    const wait = RETRY[Math.min(this.failures, RETRY.length - 1)];
    this.failures += 1;
    setTimeout(() => this.open(), wait);
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /** Send a command; resolves to {done, message}. */
  request(command) {
    if (this.socket.readyState !== WebSocket.OPEN) {
      return Promise.resolve({ done: false, message: 'there is no connection' });
    }
    this.number += 1;
    const id = this.number;
    this.send({ id, ...command });
    return new Promise((resolve) => {
      this.waiting.set(id, resolve);
      setTimeout(() => this.answered({ id, done: false, message: 'no answer' }), 8000);
    });
  }

  answered(answer) {
    const resolve = this.waiting.get(answer.id);
    this.waiting.delete(answer.id);
    if (resolve) resolve(answer);
  }
}
