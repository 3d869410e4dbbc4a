// Reader of the logs in this page: the format of antdrive's sim/log/packing.py, and the digest over the same bytes.
const DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;,=>?@^_`{|}~";
const ARRAYS = {f8: Float64Array, f4: Float32Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, i1: Int8Array,
  i2: Int16Array, i4: Int32Array};
const RATE = 240;

// Return the bytes of a text in base 85.
function base85(text) {
  const value = new Uint8Array(128);
  for (let k = 0; k < 85; k++) value[DIGITS.charCodeAt(k)] = k;
  const bytes = new Uint8Array(text.length / 5 * 4), view = new DataView(bytes.buffer);
  for (let i = 0, at = 0; i < text.length; at += 4) {
    let word = 0;
    for (let k = 0; k < 5; k++) word = word * 85 + value[text.charCodeAt(i++)];
    view.setUint32(at, word);
  }
  return bytes.subarray(4, 4 + view.getUint32(0, true));
}

// Return the head, the record's text, and the arrays of a packed log.
async function unpacked(text) {
  const stream = new Blob([base85(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer()), decoder = new TextDecoder();
  const length = new DataView(raw.buffer).getUint32(0, true), head = JSON.parse(decoder.decode(raw.subarray(4, 4 + length)));
  let at = 4 + length + head.record;
  const hashed = raw.subarray(4 + length, at), arrays = {};
  for (const [name, dtype, shape, code] of head.arrays) {
    const width = +dtype[2], count = shape.reduce((a, b) => a * b, 1), coded = new Uint8Array(count * width);
    for (let place = 0; place < width; place++)
      for (let i = 0; i < count; i++) coded[i * width + place] = raw[at++];
    const rows = shape[0], columns = rows ? count / rows : 0;
    arrays[name] = dtype === "<f8" ? restored(coded, rows, columns, code || [1, 0, 0], head.period, arrays.pose)
      : summed(coded, dtype.slice(1), rows, columns, code);
  }
  return {head, hashed, arrays, record: {...head.unhashed, ...JSON.parse(decoder.decode(hashed))}};
}

// Return floats (rows, columns) from the bits that differ from their prediction.
function restored(coded, rows, columns, [order, periods, posed], period, pose) {
  const bits = new Uint32Array(coded.buffer), table = new Float64Array(rows * columns), out = new Uint32Array(table.buffer);
  const rest = new Float64Array(table.length), wrong = new Float64Array(table.length);
  for (let row = 0; row < rows; row++) for (let k = 0; k < columns; k++) {
    const at = row * columns + k, back = Math.min(row, order), f = (by) => rest[at - by * columns], e = (by) => wrong[at - by * period * columns];
    let ahead = 0, errors = 0, base = 0;
    if (posed && row) {  // travel or turn in the step by the poses, at the usual rate
      const i = 3 * row, x = pose[i] - pose[i - 3], y = pose[i + 1] - pose[i - 2];
      base = (k ? pose[i + 2] - pose[i - 1] : Math.sqrt(x * x + y * y)) * RATE;
      if (k === 0 && table[at - columns] < 0) base *= -1;
    }
    if (back === 1) ahead = f(1);
    else if (back === 2) ahead = 2 * f(1) - f(2);
    else if (back === 3) ahead = 3 * (f(1) - f(2)) + f(3);
    else if (back === 4) ahead = 4 * (f(1) + f(3)) - (6 * f(2) + f(4));
    if (periods === 1 && row >= period) errors = e(1);
    else if (periods === 2 && row >= 2 * period) errors = 2 * e(1) - e(2);
    table[at] = base + (ahead + errors);
    const from = 2 * (k * rows + row);
    out[2 * at] ^= bits[from];
    out[2 * at + 1] ^= bits[from + 1];
    rest[at] = table[at] - base;
    wrong[at] = rest[at] - ahead;
  }
  return table;
}

// Return numbers from their differences, along columns if code is -1.
function summed(coded, kind, rows, columns, code) {
  const steps = new ARRAYS["u" + kind[1]](coded.buffer), values = new steps.constructor(steps.length);
  for (let i = 0, sum = 0; i < steps.length; i++) {
    const at = code === -1 ? (i % rows) * columns + Math.floor(i / rows) : i;
    values[at] = sum + steps[i];
    sum = values[at];
  }
  return new ARRAYS[kind](values.buffer);
}

// Return the SHA-256 of a log as Rollout.digest computes it; "" where the browser offers none.
async function digestOf({head, hashed, arrays}) {
  if (!globalThis.crypto?.subtle) return "";
  const parts = [], encoder = new TextEncoder();
  for (const [name, dtype, shape] of head.arrays) {
    const {buffer} = arrays[name];
    parts.push(encoder.encode(`${name} ${dtype} (${shape.join(", ")}${shape.length === 1 ? "," : ""})\n`), new Uint8Array(buffer));
  }
  const bytes = new Uint8Array(await new Blob([...parts, hashed]).arrayBuffer());
  const sha = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return [...sha].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
