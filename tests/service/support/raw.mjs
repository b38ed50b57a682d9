// HTTP by hand, where a client library is too polite: bytes over a socket.
import net from 'node:net';

/// Sends text or bytes over a new connection and gives back all that comes until the other side closes it, or until a whole
/// answer with a length has come: {status, headers, body, closed}; status 0 if the connection was closed without a word.
///   pieces  sent one after the other, `pause` ms apart
export const exchange = (url, pieces, { pause = 0, timeout = 20_000, halfClose = false } = {}) => new Promise((done, failed) => {
  const socket = net.connect(Number(url.port), url.hostname);
  let bytes = Buffer.alloc(0);
  let timer;
  const finish = (closed) => {
    clearTimeout(timer);
    clearInterval(sender);
    socket.destroy();
    done({ ...parse(bytes), closed });
  };
  timer = setTimeout(() => failed(new Error(`no answer in ${timeout} ms: ${pieces.join('').slice(0, 200)}`)), timeout);
  const waiting = [...pieces];
  const next = () => {
    if (waiting.length === 0) {
      clearInterval(sender);
      if (halfClose) socket.end();
    } else if (socket.writable) {
      socket.write(waiting.shift());
    }
  };
  let sender;
  socket.on('connect', () => {
    next();
    sender = setInterval(next, pause);
  });
  socket.on('data', (chunk) => {
    bytes = Buffer.concat([bytes, chunk]);
    if (isWhole(bytes)) finish(false);
  });
  socket.on('end', () => finish(true));
  socket.on('error', () => finish(true));  // reset while we were still sending: what came before counts
});

const split = (bytes) => {
  const end = bytes.indexOf('\r\n\r\n');
  if (end < 0) return null;
  const [first, ...lines] = bytes.subarray(0, end).toString('latin1').split('\r\n');
  const headers = Object.fromEntries(lines.map((line) => [line.slice(0, line.indexOf(':')).toLowerCase(), line.slice(line.indexOf(':') + 1).trim()]));
  return { status: Number(first.split(' ')[1]), headers, body: bytes.subarray(end + 4) };
};
const isWhole = (bytes) => {
  const answer = split(bytes);
  return answer !== null && answer.status >= 200 && 'content-length' in answer.headers && answer.body.length >= Number(answer.headers['content-length']);
};
const parse = (bytes) => split(bytes) ?? { status: 0, headers: {}, body: bytes };
