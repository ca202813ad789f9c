// Strips: runs of one code as blocks with their word.

const RANK = { bad: 5, warn: 4, none: 3 }; // of blocks too narrow to be distinguished the worst is drawn
const MIN_BLOCK_PX = 1.5;
const LETTER_PX = 6.4;

function runsOf(table, column, ends, until) {
  const key = `${column} ${ends}`;
  let runs = table.runs.get(key);
  if (runs !== undefined) return runs;
  const codes = table.columns[column];
  runs = { begin: [], end: [], code: [] };
  for (let i = 0; i < table.rows; i++) {
    const last = runs.code.length - 1;
    if (ends) {
      runs.begin.push(table.time[i]);
      runs.end.push(table.columns.end[i]);
      runs.code.push(codes[i]);
    } else if (last >= 0 && runs.code[last] === codes[i]) {
      runs.end[last] = i + 1 < table.rows ? table.time[i + 1] : until;
    } else {
      runs.begin.push(table.time[i]);
      runs.end.push(i + 1 < table.rows ? table.time[i + 1] : until);
      runs.code.push(codes[i]);
    }
  }
  table.runs.set(key, runs);
  return runs;
}

function wordOf(row, code) {
  return row.words[code] ?? [`${code}`, "none"];
}

// Blocks by pattern, and words, of all rows between from and to, at so many pixels a second.
function stripBlocks(rows, world, from, to, perSecond, colours) {
  const { tables, hatches, end: until } = world;
  const all = new Map(); // by pattern
  const words = { x: [], y: [], text: [], colour: [], ground: [] };
  const put = (place, left, right, row, code) => {
    if (code < 0) return;
    const [word, css] = wordOf(row, code);
    const pattern = hatches[css] ?? "blank";
    if (!all.has(pattern)) all.set(pattern, { left: [], right: [], top: [], bottom: [], colour: [] });
    const blocks = all.get(pattern);
    blocks.left.push(left);
    blocks.right.push(right);
    blocks.top.push(place + 0.12);
    blocks.bottom.push(place + 0.88);
    blocks.colour.push(colours(css));
    const begin = Math.max(left, from);
    const letters = Math.floor(((Math.min(right, to) - begin) * perSecond - 6) / LETTER_PX);
    if (letters < 2) return;
    if (word.length > letters && letters < 5) return;
    words.x.push(begin + 4 / perSecond);
    words.y.push(place + 0.52);
    words.text.push(word.length <= letters ? word : `${word.slice(0, letters - 1)}…`);
    words.colour.push(colours(`${css}-text`));
    words.ground.push(colours(css));
  };
  rows.forEach((row, place) => {
    const table = tables.get(row.table);
    if (table === undefined) return;
    const runs = runsOf(table, row.column, row.ends, until);
    let narrow = null;
    const flush = () => {
      if (narrow !== null) put(place, narrow.left, narrow.left + Math.max(narrow.right - narrow.left, MIN_BLOCK_PX / perSecond), row, narrow.code);
      narrow = null;
    };
    for (let i = Math.max(0, placeAt(runs.begin, from)); i < runs.code.length && runs.begin[i] <= to; i++) {
      const [left, right, code] = [runs.begin[i], runs.end[i], runs.code[i]];
      if ((right - left) * perSecond >= MIN_BLOCK_PX) {
        flush();
        put(place, left, right, row, code);
        continue;
      }
      if (narrow !== null && (left - narrow.left) * perSecond >= MIN_BLOCK_PX) flush();
      const rank = code < 0 ? 0 : RANK[wordOf(row, code)[1]] ?? 1;
      if (narrow === null) narrow = { left, right, code, rank };
      else {
        narrow.right = right;
        if (rank > narrow.rank) [narrow.code, narrow.rank] = [code, rank];
      }
    }
    flush();
  });
  return { all, words };
}
