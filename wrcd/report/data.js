// Unpacks what columns.py has packed: base64, gzip, byte planes, differences, whole steps.

const ARRAYS = { time: Float64Array, number: Float32Array, code: Int16Array };
const TIME_STEP_S = 1e-4; // to which times are kept
const WHOLE = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array };

async function inflate(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function unpackColumn(head, rows, bytes, offset) {
  const whole = new WHOLE[head.width](rows); // wraps round as numpy's differences did
  for (let plane = 0; plane < head.width; plane++) {
    const start = offset + plane * rows;
    for (let i = 0; i < rows; i++) whole[i] |= bytes[start + i] << (8 * plane);
  }
  for (let order = 0; order < head.order; order++) {
    for (let i = 1; i < rows; i++) whole[i] += whole[i - 1];
  }
  const values = new ARRAYS[head.kind](rows);
  const nothing = head.kind === "code" ? -1 : NaN;
  for (let i = 0; i < rows; i++) {
    values[i] = whole[i] === 0 ? nothing : (whole[i] + head.low - 1) * head.step;
  }
  return values;
}

function unpackTable(head, bytes) {
  const columns = {};
  let offset = 0;
  for (const column of head.columns) {
    const values = unpackColumn(column, head.rows, bytes, offset);
    offset += column.width * head.rows;
    if (column.base) {
      const base = columns[column.base];
      for (let i = 0; i < values.length; i++) values[i] = base[i] + column.sign * values[i];
    }
    columns[column.name] = values;
  }
  return { rows: head.rows, columns, time: columns.time, levels: new Map(), runs: new Map() };
}

async function unpackAll(heads) {
  const found = [...document.querySelectorAll("script[data-table]")];
  const tables = new Map();
  await Promise.all(found.map(async (element) => {
    const name = element.dataset.table;
    tables.set(name, unpackTable(heads[name], await inflate(element.textContent)));
    element.remove();
  }));
  return tables;
}

// Place of the last value <= x in what grows, -1 before the first.
function placeAt(values, x) {
  let low = 0;
  let high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

// Value of a column that holds until the next row; NaN or -1 where frames are missing.
function valueAt(table, column, time) {
  if (table === undefined) return NaN;
  const place = placeAt(table.time, time + TIME_STEP_S);
  if (place < 0) return NaN;
  return table.columns[column][place];
}
