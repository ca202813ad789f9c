// The explanation at the cursor, in words.

class Words {
  constructor(told, world) {
    this.told = told;
    this.world = world;
    this.element = document.getElementById("explanation");
    this.panel = document.getElementById("cursor");
    this.moment = document.getElementById("moment");
    this.range = document.getElementById("range");
    this.said = document.getElementById("said");
    this.text = "";
    this.state = "";
    this.buttons = world.axles.map((axle) => {
      const button = document.createElement("button");
      button.setAttribute("role", "radio");
      button.textContent = `axle ${axle}`;
      button.addEventListener("click", () => world.choose(axle));
      return button;
    });
    document.getElementById("axles").append(...this.buttons);
  }

  show() {
    const { world } = this;
    this.buttons.forEach((b, i) => b.setAttribute("aria-checked", `${world.axles[i] === world.axle}`));
    this.range.textContent = `${clock(world.from)} … ${clock(world.to)} of ${clock(world.end)}`;
    this.panel.classList.toggle("pointed", world.cursor !== null);
    if (world.cursor === null) return;
    const { cursor, axle } = world;
    const state = `${cursor} ${axle} ${world.kept}`;
    if (state === this.state) return;
    this.state = state;
    const short = [`${cursor.toFixed(3)} s`];
    const mu = this.value(`axle${axle}.adhesion`, "available", cursor);
    short.push(`axle ${axle}`, Number.isFinite(mu) ? `${mu.toFixed(1)} %` : "no estimate");
    this.moment.textContent = `${short.join(" · ")}${world.kept ? " · fixed" : ""}`;
    const sides = this.told.against === null ? [["", this.told.story]] : [["", this.told.story], ["against.", this.told.against]];
    const parts = [this.paragraph("when", [this.when(cursor)])];
    sides.forEach(([side, story], i) => {
      if (sides.length > 1) parts.push(this.heading(this.told.sides[i]));
      parts.push(...this.explained(side, story, axle, cursor));
    });
    this.element.replaceChildren(...parts);
    if (world.kept && this.element.textContent !== this.text) {
      this.text = this.element.textContent;
      this.said.textContent = this.text;
    }
  }

  value(table, column, seconds) {
    const found = this.world.tables.get(table);
    return found === undefined || found.columns[column] === undefined ? NaN : valueAt(found, column, seconds);
  }

  when(seconds) {
    const micros = this.told.story.begin_us + Math.round(seconds * 1e6);
    const date = new Date(micros / 1000);
    const stamp = Number.isNaN(date.getTime()) ? "" : ` · ${date.toISOString().replace("T", " ").replace("Z", " UTC")}`;
    const far = this.world.tables.has("distance") ? ` · ${this.world.kilometresAt(seconds).toFixed(3)} km` : "";
    return `${seconds.toFixed(3)} s${stamp}${far}`;
  }

  heading(text) {
    const element = document.createElement("h4");
    element.textContent = text;
    return element;
  }

  paragraph(css, texts) {
    const element = document.createElement("p");
    element.className = css;
    element.append(...texts);
    return element;
  }

  strong(text, css = "") {
    const element = document.createElement("b");
    element.textContent = text;
    if (css) element.className = css;
    return element;
  }

  explained(side, story, axle, seconds) {
    const base = `${side}axle${axle}`;
    return [
      ...this.adhesion(base, seconds), ...this.validity(base, side, story, axle, seconds), ...this.model(base, story, seconds),
      ...this.inputs(base, side, axle, seconds),
    ];
  }

  adhesion(base, seconds) {
    const { vocabulary } = this.told;
    const get = (column) => this.value(`${base}.adhesion`, column, seconds);
    if (!(get("validity") >= 0)) return [this.paragraph("values", ["No Adhesion frame here."])];
    const texts = [];
    const [mu, low, high, used] = [get("available"), get("low"), get("high"), get("used")];
    if (Number.isFinite(mu)) {
      texts.push("available ", this.strong(`${mu.toFixed(2)} %`, "available"));
      if (Number.isFinite(low)) texts.push(` (${low.toFixed(1)} to ${high.toFixed(1)} %, nine of ten)`);
    } else texts.push(this.strong("no estimate", "available"));
    if (Number.isFinite(used)) texts.push(", in use ", this.strong(`${used.toFixed(2)} %`, "used"));
    const truth = this.value(`${base}.truth`, "available", seconds);
    if (Number.isFinite(truth)) texts.push(", truth ", this.strong(`${truth.toFixed(2)} %`));
    const [contact, surface, confidence] = [
      vocabulary.contact[get("contact")], vocabulary.surface[get("surface")], vocabulary.confidence[get("confidence")]];
    return [
      this.paragraph("values", texts),
      this.paragraph("", [`Contact ${contact ?? "unknown"}, surface ${surface ?? "unknown"}, confidence ${confidence ?? "unknown"}.`]),
    ];
  }

  validity(base, side, story, axle, seconds) {
    const table = this.world.tables.get(`${base}.events`);
    const place = table === undefined ? -1 : placeAt(table.time, seconds + 1e-6);
    if (place < 0) return [];
    const { vocabulary } = this.told;
    const [begin, end] = [table.time[place], table.columns.end[place]];
    if (seconds > end + 1) return [];
    const name = vocabulary.validity[table.columns.validity[place]] ?? "unknown";
    const [label, why] = vocabulary.causes[table.columns.cause[place]] ?? ["", ""];
    const badge = this.strong(name, `state ${name}`);
    const since = ` since ${begin.toFixed(2)} s, until ${end.toFixed(2)} s (${(end - begin).toFixed(2)} s)`;
    const out = [this.paragraph("", [badge, `${since}.`])];
    if (why) {
      const detail = story.details[axle]?.[place] ?? "";
      out.push(this.paragraph("why", [this.strong(label), `: ${why}${detail ? `: ${detail}` : ""}.`]));
    } else if (name !== "Valid") {
      out.push(this.paragraph("why", [`${story.details[axle]?.[place] || "cause not known"}.`]));
    } else out.push(this.paragraph("why", ["Nothing speaks against it."]));
    return out;
  }

  model(base, story, seconds) {
    const get = (column) => this.value(`${base}.detail`, column, seconds);
    const [winner, rule] = [get("winner"), get("rule")];
    if (!(winner >= 0)) return [];
    const out = [];
    const residuals = [1, 2, 3, 4].map((m) => `${m}: ${Number.isFinite(get(`residual${m}`)) ? `${number(get(`residual${m}`), "dB")} dB` : "none"}`);
    const first = winner > 0 ? ["Model ", this.strong(`${winner} (${story.models[winner - 1]})`), " fits best. "] : ["No model wins. "];
    out.push(this.paragraph("", [...first, `Residuals ${residuals.join(", ")}.`]));
    if (rule > 0 && story.rules[rule - 1]) out.push(this.paragraph("rule", [this.strong(`Rule ${rule}: `), story.rules[rule - 1]]));
    else out.push(this.paragraph("rule", ["No rule fired."]));
    return out;
  }

  inputs(base, side, axle, seconds) {
    const { vocabulary } = this.told;
    const texts = [];
    const torque = this.value(`${base}.torque`, "torque_Nm", seconds);
    const speed = this.value(`${side}speed`, "speed_m_s", seconds);
    const age = this.value(`${base}.adhesion`, "age", seconds);
    if (Number.isFinite(torque)) texts.push(`torque ${number(torque / 1000, "", 2)} kN m`);
    if (Number.isFinite(speed)) texts.push(`speed ${number(speed, "", 2)} m/s (${number(speed * 3.6, "", 1)} km/h)`);
    if (Number.isFinite(age)) texts.push(`oldest measurement ${age.toFixed(0)} ms`);
    const out = texts.length > 0 ? [this.paragraph("", [`Inputs: ${texts.join(", ")}.`])] : [];
    const stale = this.value(`${base}.detail`, "stale", seconds);
    const troubles = vocabulary.inputs.filter((_, i) => stale > 0 && (stale >> i) & 1).map((name) => `${name} is stale`);
    ["yaw", "lateral", "torque", "speed"].forEach((name, i) => {
      const code = this.value(`${base}.inputs`, name, seconds);
      const reach = this.value(`${base}.inputs`, `${name}_reach`, seconds);
      const row = this.told.plots[`axle${axle}.inputs`]?.spec.rows[i];
      if (!(code > 0) || row === undefined) return;
      const word = row.words[code]?.[0] ?? `${code}`;
      troubles.push(`${vocabulary.inputs[i]} ${word}, reach ${reach.toString(2).padStart(8, "0")}`);
    });
    const marks = this.value(`${base}.inputs`, "marks", seconds);
    if (marks > 0 && marks & 1) troubles.push("an outlier was left out");
    if (marks > 0 && marks & 2) troubles.push("a sensor says the same again and again");
    if (troubles.length > 0) out.push(this.paragraph("why", [`${troubles.join("; ")}.`]));
    return out;
  }
}

function clock(seconds) {
  return `${seconds.toFixed(seconds < 100 ? 2 : 1)} s`;
}
