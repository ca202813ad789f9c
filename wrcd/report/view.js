// What all plots show: one range of time, one cursor, one axle. Keys, buttons and mouse change it.

const MIN_SPAN_S = 0.05;
const STEP = 1.5; // of a zoom by key or button
const AROUND_S = 4; // shown at each side of what a reader asked for

class World {
  constructor(told, tables) {
    this.tables = tables;
    this.end = Math.max(told.story.end_s, told.against?.end_s ?? 0, MIN_SPAN_S);
    [this.from, this.to] = [0, this.end];
    this.cursor = null;
    this.kept = false;
    this.axles = told.story.axles;
    this.axle = this.axles[0] ?? 0;
    this.margins = told.left + told.right;
    this.hatches = told.hatches;
    this.panes = [];
    this.listeners = [];
    this.kilometres = new Map();
    this.asked = false;
  }

  // Distance is of the log itself; the other side's curves are drawn over the same time.
  kilometresAt(seconds) {
    const table = this.tables.get("distance");
    const last = table.rows - 1;
    const place = placeAt(table.time, seconds);
    const metres = table.columns.distance_m;
    if (place < 0) return metres[0] / 1000;
    if (place >= last) return this.known(last) / 1000;
    const share = (seconds - table.time[place]) / (table.time[place + 1] - table.time[place]);
    const value = metres[place] + share * (metres[place + 1] - metres[place]);
    return (Number.isFinite(value) ? value : this.known(place)) / 1000;
  }

  // The last distance at or before a row: a gap has none.
  known(place) {
    const metres = this.tables.get("distance").columns.distance_m;
    for (let i = place; i >= 0; i--) if (Number.isFinite(metres[i])) return metres[i];
    return 0;
  }

  secondsAt(kilometres) {
    let [low, high] = [0, this.end];
    for (let i = 0; i < 40; i++) {
      const middle = (low + high) / 2;
      if (this.kilometresAt(middle) < kilometres) low = middle;
      else high = middle;
    }
    return high;
  }

  kilometresOf(name) {
    let found = this.kilometres.get(name);
    if (found === undefined) {
      found = Float64Array.from(this.tables.get(name).time, (t) => this.kilometresAt(t));
      this.kilometres.set(name, found);
    }
    return found;
  }

  show(from, to) {
    const span = Math.min(this.end, Math.max(MIN_SPAN_S, to - from));
    const middle = (from + to) / 2;
    const start = Math.min(Math.max(0, middle - span / 2), this.end - span);
    [this.from, this.to] = [start, start + span];
    for (const pane of this.panes) pane.stale = true;
    this.ask();
  }

  zoom(factor, at = null) {
    const inside = at ?? (this.cursor !== null && this.cursor >= this.from && this.cursor <= this.to ? this.cursor : (this.from + this.to) / 2);
    const span = Math.min(this.end, Math.max(MIN_SPAN_S, (this.to - this.from) * factor));
    const share = (inside - this.from) / (this.to - this.from);
    this.show(inside - share * span, inside + (1 - share) * span);
  }

  move(share) {
    const by = share * (this.to - this.from);
    this.show(this.from + by, this.to + by);
  }

  home() {
    this.show(0, this.end);
  }

  point(seconds, kept) {
    this.cursor = seconds === null ? null : Math.min(this.end, Math.max(0, seconds));
    this.kept = kept;
    if (kept && (this.cursor < this.from || this.cursor > this.to)) {
      const half = (this.to - this.from) / 2;
      this.show(this.cursor - half, this.cursor + half);
    }
    this.ask();
  }

  choose(axle) {
    if (!this.axles.includes(axle)) return;
    this.axle = axle;
    this.ask();
  }

  // A fall, a finding, an event: zoom there, put the cursor where it begins or, of a fall, where it has come to.
  go(axle, begin, end, at = begin) {
    if (axle > 0) this.choose(axle);
    const around = Math.max(AROUND_S, (end - begin) * 0.3);
    this.show(begin - around, end + around);
    this.point(at, true);
  }

  event(direction) {
    const table = this.tables.get(`axle${this.axle}.events`);
    if (table === undefined || table.rows === 0) return;
    const now = this.cursor ?? this.from;
    const place = placeAt(table.time, now + 1e-6);
    const next = direction > 0 ? place + 1 : table.time[place] < now - 1e-3 ? place : place - 1;
    if (next >= 0 && next < table.rows) this.point(table.time[next], true);
  }

  step(direction, frame) {
    const table = this.tables.get(`axle${this.axle}.adhesion`);
    const now = this.cursor ?? (this.from + this.to) / 2;
    if (!frame || table === undefined) {
      this.point(now + (direction * (this.to - this.from)) / 200, true);
      return;
    }
    const place = placeAt(table.time, now + 1e-6) + direction;
    this.point(table.time[Math.min(table.rows - 1, Math.max(0, place))], true);
  }

  // Draw at the next frame, once, whatever has changed until then.
  ask() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.draw();
    });
  }

  draw() {
    for (const pane of this.panes) {
      if (!pane.visible) continue;
      if (pane.stale) pane.update();
      pane.point(this.cursor);
    }
    for (const listener of this.listeners) listener();
  }
}

function byKeys(world) {
  const keys = {
    ArrowLeft: (e) => world.step(-1, e.shiftKey), ArrowRight: (e) => world.step(1, e.shiftKey),
    n: () => world.event(1), p: () => world.event(-1),
    "+": () => world.zoom(1 / STEP), "=": () => world.zoom(1 / STEP), "-": () => world.zoom(STEP),
    "[": () => world.move(-0.5), "]": () => world.move(0.5),
    Home: () => world.home(), Escape: () => world.point(world.cursor, false),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, select, textarea, .scroll")) return;
    const act = /^[1-8]$/.test(event.key) ? () => world.choose(Number(event.key)) : keys[event.key];
    if (act === undefined) return;
    event.preventDefault();
    act(event);
  });
}

function byButtons(world) {
  const acts = {
    before: () => world.event(-1), next: () => world.event(1), in: () => world.zoom(1 / STEP), out: () => world.zoom(STEP),
    home: () => world.home(),
  };
  document.addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (button?.dataset.do) acts[button.dataset.do]?.();
    if (!button?.classList.contains("go")) return;
    const [axle, begin, end] = ["axle", "begin", "end"].map((name) => Number(button.dataset[name]));
    const fall = button.classList.contains("fall") || button.classList.contains("rise");
    world.go(axle, begin, end, fall ? end : begin);
    const part = document.getElementById(axle > 0 ? `axle${axle}` : "overview");
    if (part === null) return;
    part.open = true;
    part.scrollIntoView({ block: "start", behavior: matchMedia("(prefers-reduced-motion: reduce)").matches ? "auto" : "smooth" });
  });
}

function byMouse(world, pane) {
  if (pane.spec.axis === "age") return;
  const { place } = pane;
  const at = (event) => event.clientX - place.getBoundingClientRect().left;
  let pressed = null;
  place.addEventListener("pointermove", (event) => {
    if (pane.view === null) return;
    if (pressed === null) {
      if (!world.kept && event.pointerType === "mouse") world.point(pane.seconds(at(event)), false);
      return;
    }
    const now = at(event);
    pressed.moved ||= Math.abs(now - pressed.at) > 4;
    if (!pressed.moved) return;
    if (pressed.shift) {
      const by = pressed.seconds - pane.seconds(now);
      world.show(world.from + by, world.to + by);
    } else pane.select(pressed.at, now);
  });
  place.addEventListener("pointerdown", (event) => {
    if (pane.view === null || event.button !== 0) return;
    if (event.pointerType === "mouse") place.setPointerCapture(event.pointerId);
    pressed = { at: at(event), seconds: pane.seconds(at(event)), shift: event.shiftKey, moved: false };
  });
  const release = (event) => {
    if (pressed === null) return;
    const { moved, shift, seconds } = pressed;
    pressed = null;
    pane.select(null, null);
    if (event.type === "pointercancel") return;
    const now = pane.seconds(at(event));
    if (!moved) {
      if (pane.spec.axle > 0) world.choose(pane.spec.axle);
      world.point(now, true);
    } else if (!shift && event.pointerType === "mouse") world.show(Math.min(seconds, now), Math.max(seconds, now));
  };
  place.addEventListener("pointerup", release);
  place.addEventListener("pointercancel", release);
  place.addEventListener("pointerleave", () => {
    if (!world.kept && pressed === null) world.point(null, false);
  });
  place.addEventListener("dblclick", () => world.home());
  place.addEventListener("wheel", (event) => {
    if (pane.view === null || !(event.ctrlKey || event.metaKey || event.shiftKey)) return; // the page scrolls
    event.preventDefault();
    const turn = Math.max(-240, Math.min(240, event.deltaY || event.deltaX)) / 120;
    if (event.shiftKey) world.move(turn * 0.1);
    else world.zoom(1.25 ** turn, pane.seconds(at(event)));
  }, { passive: false });
}
