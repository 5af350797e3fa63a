'use strict';
/*
 * The socket: one frame at a time, answered when it is its turn to be drawn, so that the next one is
 * under way meanwhile. A frame that is not drawn is not answered, so nothing queues up, neither here
 * nor there.
 */

// Says that the page is there, while it drives [ms]; view_node lets go after 350.
const BEAT = 100;
const RETRY = [500, 1000, 2000, 4000];

class Connection {
  /** `draw` is given each frame, `changed` whether there is a connection. */
  constructor(draw, changed) {
    this.draw = draw;
    this.changed = changed;
    this.number = 0;
    this.waiting = new Map();
    this.failures = 0;
    this.drives = false;
    setInterval(() => this.drives && this.say({}), BEAT);
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

  /** Take a frame. What moves nothing waits for no screen: the pose comes right behind its answer. */
  receive(socket, text) {
    const frame = JSON.parse(text);
    if (frame.poses) requestAnimationFrame(() => this.take(socket, frame));
    else this.take(socket, frame);
  }

  take(socket, frame) {
    if (socket !== this.socket || socket.readyState !== WebSocket.OPEN) return;
    if (frame.n === 1) this.changed(true, '');
    this.failures = 0;
    this.say({ ack: frame.n });
    for (const answer of frame.answers || []) this.answered(answer);
    this.draw(frame);
  }

  close(socket, event) {
    if (socket !== this.socket) return;
    for (const tell of this.waiting.values()) tell({ done: false, said: 'the connection is lost' });
    this.waiting.clear();
    this.drives = false;
    this.changed(false, event.reason);
    const wait = RETRY[Math.min(this.failures, RETRY.length - 1)];
    this.failures += 1;
    setTimeout(() => this.open(), wait);
  }

  say(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /** Want something done; resolves to {done, said}. */
  want(wish) {
    if (this.socket.readyState !== WebSocket.OPEN) {
      return Promise.resolve({ done: false, said: 'there is no connection' });
    }
    this.number += 1;
    const id = this.number;
    this.say({ id, ...wish });
    return new Promise((tell) => {
      this.waiting.set(id, tell);
      setTimeout(() => this.answered({ id, done: false, said: 'no answer' }), 8000);
    });
  }

  answered(answer) {
    const tell = this.waiting.get(answer.id);
    this.waiting.delete(answer.id);
    if (tell) tell(answer);
  }
}
