// The npm package tuio-client over WebSocket.  Usage: node npm_websocket_client.mjs NODE_MODULES PORT
// Connects to the server there.  Prints "ready", then a line for each thing that happens: add, update
// or remove, the id, x and y; of blobs blob, the id, width and height.  Ends with its standard input.
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const [modules, port] = process.argv.slice(2);
const build = join(resolve(modules), 'tuio-client', 'dist', 'tuio-client.es.js');
const { Tuio11Client, TuioReceiver } = await import(pathToFileURL(build));
const OSC = createRequire(join(resolve(modules), 'index.js'))('osc-js');

class WebSocketReceiver extends TuioReceiver {
  connect() {
    const plugin = new OSC.WebsocketClientPlugin({ host: '127.0.0.1', port: Number(port) });
    this.osc = new OSC({ plugin });
    this.osc.on('open', () => console.log('ready'));
    this.osc.on('*', (message) => this.onOscMessage(message));
    this.osc.open();
    this.isConnected = true;
  }

  disconnect() {
    this.osc.close();
  }
}

const show = (kind) => (cursor) =>
  console.log(kind, cursor.sessionId, cursor.position.x, cursor.position.y);
const ignore = () => {};
const client = new Tuio11Client(new WebSocketReceiver());
client.addTuioListener({
  addTuioCursor: show('add'),
  updateTuioCursor: show('update'),
  removeTuioCursor: show('remove'),
  addTuioObject: ignore,
  updateTuioObject: ignore,
  removeTuioObject: ignore,
  addTuioBlob: (blob) => console.log('blob', blob.sessionId, blob.size.x, blob.size.y),
  updateTuioBlob: ignore,
  removeTuioBlob: ignore,
  refresh: ignore,
});
client.connect();
process.stdin.resume();
process.stdin.on('end', () => process.exit(0));
