// multipart/form-data (RFC 7578).
const boundary = 'splatdrag-test-7e3f1c';
export const formType = `multipart/form-data; boundary=${boundary}`;

/// parts  [{name, filename?, bytes}]
export const form = (parts) => Buffer.concat([
  ...parts.flatMap(({ name, filename, bytes }) => [
    Buffer.from(`--${boundary}\r\nContent-Disposition: form-data; name="${name}"${filename === undefined ? '' : `; filename="${filename}"`}\r\n` +
      `${filename === undefined ? '' : 'Content-Type: application/octet-stream\r\n'}\r\n`),
    Buffer.from(bytes), Buffer.from('\r\n')]),
  Buffer.from(`--${boundary}--\r\n`)]);
