// The npm package tuio-client over UDP.  Usage: node npm_client.mjs NODE_MODULES PORT
// Prints "ready", then a line for each thing that happens: add, update or remove, the id, x and y.
// Ends with its standard input.
import dgram from 'node:dgram';
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const [modules, port] = process.argv.slice(2);
// "main" of tuio-client names a CommonJS file in a package of ES modules, which Node refuses.
const build = join(resolve(modules), 'tuio-client', 'dist', 'tuio-client.es.js');
const { Tuio11Client, TuioReceiver } = await import(pathToFileURL(build));
const OSC = createRequire(join(resolve(modules), 'index.js'))('osc-js');

class UdpReceiver extends TuioReceiver {
  connect() {
    this.socket = dgram.createSocket('udp4');
    this.socket.on('message', (datagram) => this.take(datagram));
    this.socket.bind(Number(port), '127.0.0.1', () => console.log('ready'));
    this.isConnected = true;
  }

  take(datagram) {
    const packet = new OSC.Packet();
    packet.unpack(new DataView(datagram.buffer, datagram.byteOffset, datagram.length));
    packet.value.bundleElements.forEach((message) => this.onOscMessage(message));
  }

  disconnect() {
    this.socket.close();
  }
}

const show = (kind) => (cursor) =>
  console.log(kind, cursor.sessionId, cursor.position.x, cursor.position.y);
const ignore = () => {};
const client = new Tuio11Client(new UdpReceiver());
client.addTuioListener({
  addTuioCursor: show('add'),
  updateTuioCursor: show('update'),
  removeTuioCursor: show('remove'),
  addTuioObject: ignore,
  updateTuioObject: ignore,
  removeTuioObject: ignore,
  addTuioBlob: ignore,
  updateTuioBlob: ignore,
  removeTuioBlob: ignore,
  refresh: ignore,
});
client.connect();
process.stdin.resume();
process.stdin.on('end', () => process.exit(0));
