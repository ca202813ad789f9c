// One plot: Bokeh draws it; what it draws, and over which range, follows the view.

const SPARE = 0.3; // of the range in view, drawn at each side of it, so that moving needs no new data
const PX_PER_BIN = 2;
const MAX_TRAVEL = 25; // heights of the plot that a dashed line may go up and down
const DASHES = { dashed: [6], dotted: [2, 4], dotdash: [2, 4, 6, 4] };
const PX_PER_TICK = 90; // along an axis, of time and distance: a label takes up to 65
const MAX_TICKS = 8;
const ZOOM_SLACK = 1.3; // a change of span by more than this takes another level of detail

function colours(name) {
  const value = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  return value === "" ? "#888888" : value;
}

class Pane {
  constructor(figure, told, world) {
    this.figure = figure;
    this.place = figure.querySelector(".plot");
    this.legend = figure.querySelector(".legend");
    this.spec = told.spec;
    this.item = told.item;
    this.world = world;
    this.visible = false;
    this.stale = true;
    this.view = null; // Bokeh's, once it is built
    this.building = null;
    this.cover = null;
    this.chips = this.spec.curves.map((curve) => this.chip(curve));
    this.overlay = document.createElement("div");
    this.overlay.className = "overlay";
    this.line = document.createElement("div");
    this.line.className = "line";
    this.line.hidden = true;
    this.mark = document.createElement("div");
    this.mark.className = "mark";
    this.mark.hidden = true;
    this.dots = this.spec.curves.map((curve) => {
      const dot = document.createElement("div");
      dot.className = "dot";
      dot.hidden = true;
      dot.style.setProperty("--c", `var(--${curve.colour})`);
      dot.append(document.createElement("span"));
      return dot;
    });
    this.overlay.append(this.mark, this.line, ...this.dots);
    this.place.append(this.overlay);
  }

  chip(curve) {
    const chip = document.createElement("span");
    chip.className = curve.shape === "band" ? "chip wide" : "chip";
    chip.style.setProperty("--c", `var(--${curve.colour})`);
    const swatch = document.createElement("i");
    swatch.className = curve.dash;
    const value = document.createElement("output");
    chip.append(swatch, `${curve.label} `, value);
    this.legend.append(chip);
    return value;
  }

  build() {
    this.building ??= (async () => {
      const manager = await Bokeh.embed.embed_item(this.item, this.place);
      this.view = manager.roots[0];
      this.sources = new Map(this.view.model.renderers.map((r) => [r.name, r]));
      this.theme();
      this.update();
    })();
    return this.building;
  }

  theme() {
    if (this.view === null) return;
    const plot = this.view.model;
    const text = colours("text");
    const faint = colours("grid");
    plot.setv({ background_fill_color: colours("plot"), border_fill_color: null, border_line_color: null, outline_line_color: faint });
    for (const axis of [...plot.below, ...plot.left]) {
      axis.setv({ major_label_text_color: text, axis_line_color: faint, major_tick_line_color: faint });
    }
    for (const grid of plot.center) grid.setv({ grid_line_color: faint });
    this.spec.curves.forEach((curve, i) => {
      const { glyph } = this.sources.get(`${i}`);
      const colour = colours(curve.colour);
      glyph.setv(curve.shape === "band" ? { fill_color: colour } : { line_color: colour });
    });
    this.cover = null;
    this.stale = true;
  }

  // Seconds to what the axis counts, and back.
  toAxis(seconds) {
    return this.spec.axis === "distance" ? this.world.kilometresAt(seconds) : seconds;
  }

  toSeconds(x) {
    return this.spec.axis === "distance" ? this.world.secondsAt(x) : x;
  }

  // Brings range and data up to what the world shows. Draws at the browser's next frame.
  update() {
    if (this.view === null) return;
    this.stale = false;
    const fixed = this.spec.axis === "age";
    let from = fixed ? 0 : this.toAxis(this.world.from);
    let to = fixed ? this.lastAge() : this.toAxis(this.world.to);
    if (!(to - from > 1e-6)) [from, to] = [from - 0.005, from + 0.005]; // the train stands
    const width = Math.max(50, this.view.frame.bbox.width || this.place.clientWidth - this.world.margins);
    this.view.model.below[0].ticker.desired_num_ticks = Math.max(2, Math.min(MAX_TICKS, Math.round(width / PX_PER_TICK)));
    const { cover } = this;
    const span = to - from;
    const covered = cover !== null && cover.width === width && from >= cover.from && to <= cover.to
      && span <= cover.span * ZOOM_SLACK && span >= cover.span / ZOOM_SLACK;
    if (!covered) {
      const spare = fixed ? 0 : span * SPARE;
      this.cover = { from: from - spare, to: to + spare, span, width };
      this.fill(this.cover, width * (1 + 2 * SPARE) / PX_PER_BIN);
    }
    this.view.model.x_range.setv({ start: from, end: to });
  }

  lastAge() {
    const ends = this.spec.curves.map((c) => this.world.tables.get(c.table)?.time.at(-1) ?? 0);
    return Math.max(5, ...ends);
  }

  fill(cover, bins) {
    const { tables } = this.world;
    if (this.spec.rows.length > 0) {
      const { all, words } = stripBlocks(this.spec.rows, this.world, cover.from, cover.to, cover.width / cover.span, colours);
      for (const [name, renderer] of this.sources) {
        if (name !== "words") renderer.data_source.data = all.get(name) ?? { left: [], right: [], top: [], bottom: [], colour: [] };
      }
      this.sources.get("words").data_source.data = words;
      return;
    }
    this.spec.curves.forEach((curve, i) => {
      const table = tables.get(curve.table);
      if (table === undefined) return;
      const x = this.spec.axis === "distance" ? this.world.kilometresOf(curve.table) : table.time;
      const points = curve.shape === "band" ? bandPoints : linePoints;
      const { data, travel } = points(table, x, curve, cover.from, cover.to, bins);
      const renderer = this.sources.get(`${i}`);
      renderer.data_source.data = data;
      // in noise nobody sees dashes, and there they cost more than all else
      const noise = travel > MAX_TRAVEL * (this.spec.high - this.spec.low);
      if (curve.dash !== "solid" && curve.shape !== "band") renderer.glyph.line_dash = noise ? [] : DASHES[curve.dash];
    });
  }

  // Pixels of a time inside the plot's place, NaN outside the frame.
  pixel(seconds) {
    const { left, width } = this.view.frame.bbox;
    const { start, end } = this.view.model.x_range;
    const x = left + ((this.toAxis(seconds) - start) / (end - start)) * width;
    return x >= left - 0.5 && x <= left + width + 0.5 ? x : NaN;
  }

  seconds(pixel) {
    const { left, width } = this.view.frame.bbox;
    const { start, end } = this.view.model.x_range;
    const share = Math.min(1, Math.max(0, (pixel - left) / width));
    return this.toSeconds(start + share * (end - start));
  }

  // Cursor, dots and values. No part of Bokeh's canvas is drawn again.
  point(cursor) {
    if (this.view === null) return;
    const { bbox } = this.view.frame;
    const x = cursor === null || this.spec.axis === "age" ? NaN : this.pixel(cursor);
    this.line.hidden = Number.isNaN(x);
    if (!this.line.hidden) {
      this.line.style.transform = `translateX(${x}px)`;
      this.line.style.top = `${bbox.top}px`;
      this.line.style.height = `${bbox.height}px`;
      this.line.classList.toggle("kept", this.world.kept);
    }
    const shown = [];
    this.spec.curves.forEach((curve, i) => {
      const value = this.spec.axis === "age" || cursor === null ? NaN : valueAt(this.world.tables.get(curve.table), curve.column, cursor);
      const band = curve.shape === "band";
      const upper = band ? valueAt(this.world.tables.get(curve.table), curve.upper, cursor ?? 0) : NaN;
      const text = Number.isFinite(value) ? (band ? `${number(value, this.spec.unit)} … ` : "") + number(band ? upper : value, this.spec.unit) : "";
      if (this.chips[i].textContent !== text) this.chips[i].textContent = text;
      const dot = this.dots[i];
      dot.hidden = band || Number.isNaN(x) || !Number.isFinite(value) || curve.label === "winner";
      if (dot.hidden) return;
      const y = bbox.top + ((this.spec.high - value) / (this.spec.high - this.spec.low)) * bbox.height;
      dot.hidden = y < bbox.top - 1 || y > bbox.bottom + 1;
      if (!dot.hidden) shown.push({ dot, y, text });
    });
    // words beside the dots, one below the other where curves are close
    shown.sort((a, b) => a.y - b.y);
    let below = -Infinity;
    for (const s of shown) {
      const at = Math.max(s.y, below + 13);
      below = at;
      s.dot.style.transform = `translate(${x}px, ${s.y}px)`;
      s.dot.classList.toggle("left", x > bbox.left + bbox.width - 60);
      s.dot.firstChild.style.top = `${at - s.y - 8}px`;
      s.dot.firstChild.textContent = s.text;
    }
  }

  // Where a drag has marked something.
  select(from, to) {
    this.mark.hidden = from === null;
    if (from === null) return;
    const { bbox } = this.view.frame;
    Object.assign(this.mark.style, {
      left: `${Math.min(from, to)}px`, width: `${Math.abs(to - from)}px`, top: `${bbox.top}px`, height: `${bbox.height}px`,
    });
  }
}

const DIGITS = { "%": 1, dB: 1, "m/s": 2, "N m": 0, ms: 0, "1/s": 0 };

function number(value, unit, digits = DIGITS[unit] ?? 0) {
  return value.toFixed(digits).replace("-", "−");
}
