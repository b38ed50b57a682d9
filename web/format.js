// Numbers, and what the service says, as people read them.

/** 62000 -> "62,000". */
export const count = (n) => Math.round(n).toLocaleString("en-US");

/** "1 handle", "2 handles". */
export const counted = (n, noun) => `${count(n)} ${noun}${n === 1 ? "" : "s"}`;

export const gaussians = (n) => counted(n, "Gaussian");

/** Bytes in powers of 1000: "14.2 MB". */
export function bytes(n) {
  if (!(n >= 1000)) return `${Math.round(n || 0)} B`;
  const units = ["kB", "MB", "GB", "TB"];
  const power = Math.min(units.length, Math.floor(Math.log10(n) / 3));
  const value = n / 1000 ** power;
  return `${value.toFixed(value < 99.95 ? 1 : 0)} ${units[power - 1]}`;
}

/** A loss: its first digits are what one compares. */
export const loss = (x) => (typeof x === "number" ? Number(x.toPrecision(3)).toString() : "unknown");

/** "12 ms", "0.4 s", "12 s", "3 min 20 s", "2 h 5 min". */
export function duration(seconds) {
  if (typeof seconds !== "number" || !(seconds >= 0)) return "";
  if (seconds < 0.1 && seconds > 0) return `${Math.max(1, Math.round(seconds * 1000))} ms`;
  if (seconds < 9.95) return `${seconds.toFixed(1)} s`;
  const s = Math.round(seconds);
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min${s % 60 ? ` ${s % 60} s` : ""}`;
  const minutes = Math.round(s / 60);
  return `${Math.floor(minutes / 60)} h${minutes % 60 ? ` ${minutes % 60} min` : ""}`;
}

/** A coordinate with as many digits as help: six significant ones, without a tail of zeros. */
export function coordinate(x) {
  if (!Number.isFinite(x)) return "";
  const rounded = Number(x.toPrecision(6));
  return String(Object.is(rounded, -0) ? 0 : rounded);
}

/** The three coordinates of a point, all to the last digit that counts in the largest of them. */
export function coordinates(p) {
  const largest = Math.max(...p.map(Math.abs));
  if (!(largest > 0) || !Number.isFinite(largest)) return p.map(coordinate);
  const digits = Math.min(15, 5 - Math.floor(Math.log10(largest)));
  const unit = 10 ** digits;
  return p.map((x) => coordinate(digits >= 0 ? Math.round(x * unit) / unit : x));
}

export const point = (p) => coordinates(p).join(", ");

/** When something happened: the time today, the date before. */
export function when(rfc3339, now = new Date()) {
  const date = new Date(rfc3339);
  if (Number.isNaN(date.getTime())) return "";
  const time = date.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
  if (date.toDateString() === now.toDateString()) return `today ${time}`;
  return `${date.toLocaleDateString([], { year: "numeric", month: "short", day: "numeric" })} ${time}`;
}

/** The name of a scene for an uploaded file: "chair.compressed.ply" -> "chair". */
export function nameOfFile(filename) {
  return filename.replace(/\.(compressed\.ply|ply|splat|spz|sog|glb)$/i, "") || filename;
}

/** What the service says, begun as a sentence: with a capital letter, unless it begins with a name ("chair.ply"). */
export const said = (text) => (/^[a-z]+(?=[ ,])/.test(text) ? `${text[0].toUpperCase()}${text.slice(1)}` : text);
