// Levels of detail: the lowest and highest of every 4, 8, 16 … rows, so that a plot draws about one bin a pixel.

const FIRST_BIN = 4;

function coarser(low, high, holes, count) {
  const bins = Math.ceil(count / 2);
  const out = { low: new Float32Array(bins), high: new Float32Array(bins), holes: new Uint8Array(bins) };
  for (let i = 0; i < bins; i++) {
    const a = 2 * i;
    const b = Math.min(a + 1, count - 1);
    // a comparison with NaN is false: the other one is taken
    out.low[i] = low[b] < low[a] || low[a] !== low[a] ? low[b] : low[a];
    out.high[i] = high[b] > high[a] || high[a] !== high[a] ? high[b] : high[a];
    out.holes[i] = holes[a] | holes[b];
  }
  return out;
}

// Levels of a column, or of a band between two.
function levelsOf(table, column, upper) {
  const key = `${column} ${upper}`;
  let levels = table.levels.get(key);
  if (levels !== undefined) return levels;
  const low = table.columns[column];
  const high = table.columns[upper || column];
  const holes = new Uint8Array(low.length);
  for (let i = 0; i < low.length; i++) holes[i] = low[i] !== low[i] || high[i] !== high[i] ? 1 : 0;
  levels = [];
  let level = { low, high, holes };
  for (let size = 2; level.low.length > 64; size *= 2) {
    level = coarser(level.low, level.high, level.holes, level.low.length);
    if (size >= FIRST_BIN) levels.push({ size, ...level });
  }
  table.levels.set(key, levels);
  return levels;
}

// Rows or bins of a table whose x lies in [from, to], one more at each side: calls take(x, low, high, hole).
function eachBin(table, x, column, upper, from, to, bins, take) {
  const first = Math.max(0, placeAt(x, from));
  const last = Math.min(table.rows, placeAt(x, to) + 2);
  const levels = last - first <= 2 * bins ? [] : levelsOf(table, column, upper);
  if (levels.length === 0) {
    const low = table.columns[column];
    const high = table.columns[upper || column];
    for (let i = first; i < last; i++) take(x[i], low[i], high[i], low[i] !== low[i] || high[i] !== high[i], 0);
    return;
  }
  const level = levels.find((l) => (last - first) / l.size <= bins) ?? levels[levels.length - 1];
  const half = (0.5 * (to - from)) / bins;
  const end = Math.min(level.low.length, Math.ceil(last / level.size));
  for (let i = Math.floor(first / level.size); i < end; i++) {
    take(x[i * level.size], level.low[i], level.high[i], level.holes[i] !== 0, half);
  }
}

function linePoints(table, x, curve, from, to, bins) {
  const xs = [];
  const ys = [];
  let travel = 0; // of the line, up and down
  eachBin(table, x, curve.column, "", from, to, bins, (at, low, high, hole, half) => {
    const step = Math.abs(low - ys[ys.length - 1]) + high - low;
    if (step === step) travel += step;
    if (half === 0) {
      xs.push(at);
      ys.push(low);
      return;
    }
    xs.push(at, at + half);
    ys.push(low, high);
    if (hole) {
      xs.push(at + half);
      ys.push(NaN);
    }
  });
  return { data: { x: xs, y: ys }, travel };
}

// A band as one outline for each stretch without a hole: along its lower edge and back along the upper one.
function bandPoints(table, x, curve, from, to, bins) {
  const xs = [];
  const ys = [];
  let stretch = [];
  const close = () => {
    for (const [at, low] of stretch) {
      xs.push(at);
      ys.push(low);
    }
    for (let i = stretch.length - 1; i >= 0; i--) {
      xs.push(stretch[i][0]);
      ys.push(stretch[i][2]);
    }
    if (stretch.length > 0) {
      xs.push(NaN);
      ys.push(NaN);
    }
    stretch = [];
  };
  eachBin(table, x, curve.column, curve.upper, from, to, bins, (at, low, high, hole, half) => {
    if (low === low && high === high) {
      stretch.push([at, low, high]);
      if (half > 0) stretch.push([at + half, low, high]);
    }
    if (hole) close();
  });
  close();
  return { data: { x: xs, y: ys }, travel: 0 };
}
