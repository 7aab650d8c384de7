// SPDX-License-Identifier: MIT
// Lanes of signals on a canvas: one a channel, lowest and highest value of each column of time, newest at the right.
// Holes of the measurement are red, columns that did not reach the page grey.

const LABEL = 172, FOOT = 22, LEAST = 34; // px: names at the left, time axis below, height of a lane
const MISSING = 1, NOT_SENT = 2;
const STEPS = [1, 2, 5, 10, 20, 60, 120, 300, 600, 1800, 3600, 7200, 21600]; // s between two numbers of the time axis

export function numbers(text, Kind = Float32Array) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
  return Kind === Uint8Array ? bytes : new Kind(bytes.buffer);
}

export class Lanes {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.span = 10;
    this.held = this.whole = false;
    this.heldAt = null;
    this.draws = 0;
    this.reset([], 1, 1);
    canvas.addEventListener("wheel", (event) => this.scroll(event), { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowDown: 1, ArrowUp: -1, PageDown: 5, PageUp: -5 }[event.key];
      if (step && this.move(step)) event.preventDefault();
    });
    new ResizeObserver(() => this.want()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.want());
  }

  // channels [{name, unit}], columns kept, seconds of one
  reset(channels, columns, seconds) {
    this.channels = channels;
    this.columns = columns;
    this.seconds = seconds;
    this.rate = 0;
    this.low = channels.map(() => new Float32Array(columns).fill(NaN));
    this.high = channels.map(() => new Float32Array(columns).fill(NaN));
    this.marks = channels.map(() => new Uint8Array(columns).fill(NOT_SENT));
    this.scale = channels.map(() => null);
    this.gaps = new Map();
    this.begin = this.end = 0;
    this.held = false;
    this.heldAt = null;
    this.top = 0;
    this.shown = channels.map((_, k) => k);
    this.want();
  }

  add({ first, count, low, high, marks }) {
    const [lows, highs, holes] = [numbers(low), numbers(high), numbers(marks, Uint8Array)];
    if (this.end === 0 && this.begin === 0) this.begin = this.end = first;
    if (first > this.end + this.columns || first + count + this.columns < this.end) this.begin = this.end = first;
    for (let k = this.end; k < first; k++) { // frames that were left out for a slow browser
      for (let c = 0; c < this.channels.length; c++) this.put(c, k, NaN, NaN, NOT_SENT);
    }
    for (let c = 0; c < this.channels.length; c++) {
      for (let k = 0; k < count; k++) this.put(c, first + k, lows[c * count + k], highs[c * count + k], holes[c * count + k]);
    }
    this.begin = Math.min(this.begin, first);
    this.end = Math.max(this.end, first + count);
    if (!this.held) this.want();
  }

  put(channel, column, low, high, mark) {
    const at = column % this.columns;
    this.low[channel][at] = low;
    this.high[channel][at] = high;
    this.marks[channel][at] = mark;
  }

  // A gap that okid reported: samples first .. last of a channel by name.
  gap(name, first, last) {
    if (!this.gaps.has(name)) this.gaps.set(name, []);
    const own = this.gaps.get(name);
    own.push([first, last]);
    if (own.length > 300) own.shift();
  }

  hold(on) {
    this.held = on;
    this.heldAt = null;
    this.want();
  }

  // The right edge at stream time t in s; null: the newest.
  goTo(t) {
    this.held = t !== null;
    this.heldAt = t === null ? null : Math.min(this.end, Math.round(t / this.seconds));
    this.want();
  }

  choose(shown) {
    this.shown = shown;
    this.move(0);
    this.want();
  }

  fitting() {
    return Math.max(1, Math.floor((this.canvas.clientHeight - FOOT) / LEAST));
  }

  move(step) {
    const before = this.top;
    this.top = Math.max(0, Math.min(this.shown.length - this.fitting(), this.top + step));
    if (this.top !== before) this.want();
    return this.top !== before;
  }

  scroll(event) {
    if (this.shown.length > this.fitting() && this.move(Math.sign(event.deltaY))) event.preventDefault();
  }

  // Draws at the next frame, once however often it is asked for, and not while it cannot be seen.
  want() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      if (this.canvas.clientHeight > 0 && this.visible !== false) this.draw();
    });
  }

  draw() {
    const { canvas, context } = this, width = canvas.clientWidth, height = canvas.clientHeight;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const style = getComputedStyle(canvas);
    this.colour = {};
    for (const name of ["ink", "muted", "grid", "line", "accent", "bad", "hole", "warn", "panel"]) this.colour[name] = style.getPropertyValue(`--${name}`).trim();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    this.draws += 1;
    const count = Math.min(this.fitting(), this.shown.length);
    if (count === 0) return;
    this.top = Math.max(0, Math.min(this.shown.length - count, this.top));
    const tall = (height - FOOT) / count, end = this.held ? this.heldAt ?? (this.heldAt = this.end) : this.end;
    if (this.whole) this.span = Math.max(1, end * this.seconds);
    const view = { end, first: end - Math.round(this.span / this.seconds), left: LABEL, wide: width - LABEL - 4 };
    this.axis(view, height - FOOT);
    for (let k = 0; k < count; k++) this.lane(this.shown[this.top + k], k * tall, tall, view);
    if (count < this.shown.length) this.bar(width, height - FOOT, count);
  }

  // A thin bar at the right edge: which of the lanes these are.
  bar(width, height, count) {
    const part = height / this.shown.length;
    this.context.fillStyle = this.colour.muted;
    this.context.fillRect(width - 3, this.top * part, 3, count * part);
  }

  axis(view, y) {
    const { context, colour } = this, step = STEPS.find((s) => this.span <= 10 * s) || 86400;
    const from = view.first * this.seconds, to = view.end * this.seconds;
    context.font = "11.5px system-ui, sans-serif";
    context.textBaseline = "top";
    context.textAlign = "center";
    for (let t = Math.max(0, Math.ceil(from / step) * step); t <= to + 1e-9; t += step) {
      const x = view.left + (view.wide * (t - from)) / this.span;
      context.fillStyle = colour.grid;
      context.fillRect(Math.round(x), 0, 1, y);
      context.fillStyle = colour.muted;
      if (x > view.left + 12 && x < view.left + view.wide - 8) context.fillText(String(Math.round(t)), x, y + 5);
    }
    context.textAlign = "right";
    context.fillText("stream time t [s]", view.left - 12, y + 5);
  }

  // Lowest and highest of each pixel column; marks of the worst kind.
  reduced(channel, view) {
    const wide = Math.max(1, Math.floor(view.wide)), columns = view.end - view.first;
    const low = new Float32Array(wide).fill(NaN), high = new Float32Array(wide).fill(NaN), marks = new Uint8Array(wide);
    const from = Math.max(view.first, this.begin, this.end - this.columns);
    for (let k = from; k < Math.min(view.end, this.end); k++) {
      const at = k % this.columns, x = Math.min(wide - 1, Math.floor(((k - view.first) * wide) / columns));
      const a = this.low[channel][at], b = this.high[channel][at], mark = this.marks[channel][at];
      if (!(low[x] <= a)) low[x] = a === a ? a : low[x];
      if (!(high[x] >= b)) high[x] = b === b ? b : high[x];
      if (mark && marks[x] !== MISSING) marks[x] = mark;
    }
    return { low, high, marks, step: Math.max(1, Math.ceil(wide / columns)), start: Math.floor(((from - view.first) * wide) / columns) };
  }

  // A scale that grows at once and shrinks only when it is far too large: lanes do not breathe.
  range(channel, low, high) {
    let least = Infinity, most = -Infinity;
    for (let k = 0; k < low.length; k++) {
      if (low[k] < least) least = low[k];
      if (high[k] > most) most = high[k];
    }
    if (least > most) return this.scale[channel];
    const old = this.scale[channel], span = most - least || Math.abs(most) || 1;
    const grown = old && (least < old[0] || most > old[1]), slack = old && span < 0.45 * (old[1] - old[0]);
    if (!old || grown || slack) this.scale[channel] = [least - 0.08 * span, most + 0.08 * span];
    return this.scale[channel];
  }

  lane(channel, y, tall, view) {
    const { context, colour } = this, { low, high, marks, step, start } = this.reduced(channel, view);
    const range = this.range(channel, low, high);
    context.fillStyle = colour.line;
    context.fillRect(0, Math.round(y + tall) - 1, view.left + view.wide, 1);
    this.label(channel, y, tall, range);
    context.fillStyle = colour.hole;
    for (let x = Math.max(0, start); x < marks.length; x++) if (marks[x] === NOT_SENT) context.fillRect(view.left + x, y + 1, step, tall - 3);
    context.fillStyle = colour.bad;
    for (let x = 0; x < marks.length; x++) if (marks[x] === MISSING) context.fillRect(view.left + x, y + 1, Math.max(step, 1), tall - 3);
    this.drawGaps(channel, y, tall, view);
    if (!range) return;
    const place = (value) => y + 2 + (tall - 5) * (1 - (value - range[0]) / (range[1] - range[0]));
    context.fillStyle = colour.accent;
    context.beginPath();
    for (let x = 0; x < low.length; ) {
      if (low[x] !== low[x]) x += 1;
      else x = this.outline(low, high, x, step, view.left, place);
    }
    context.fill();
  }

  // One run of columns as a closed outline: tops from left to right, feet back. Each column reaches as far as the middle
  // of the one before, or steep signals would fall apart into dots. Returns the column behind the run.
  outline(low, high, from, step, left, place) {
    const feet = [];
    let x = from, middle = NaN;
    for (; x < low.length; x += step) {
      if (low[x] !== low[x]) {
        if (step === 1) break;
        let next = x; // columns wider than a pixel do not all begin a whole number of pixels apart
        while (next < x + step && next < low.length && low[next] !== low[next]) next += 1;
        if (next === x + step || next === low.length) break;
        x = next;
      }
      let top = place(high[x]), foot = place(low[x]);
      const own = (top + foot) / 2;
      if (middle === middle) {
        top = Math.min(top, middle);
        foot = Math.max(foot, middle);
      }
      middle = own;
      if (x === from) this.context.moveTo(left + x, top - 0.6);
      this.context.lineTo(left + x, top - 0.6);
      this.context.lineTo(left + x + step, top - 0.6);
      feet.push([left + x, foot + 0.6]);
    }
    for (let k = feet.length - 1; k >= 0; k--) {
      this.context.lineTo(feet[k][0] + step, feet[k][1]);
      this.context.lineTo(feet[k][0], feet[k][1]);
    }
    this.context.closePath();
    return Math.max(x, from + 1);
  }

  drawGaps(channel, y, tall, view) {
    const own = this.gaps.get(this.channels[channel].name);
    if (!own || !this.rate) return;
    const scale = view.wide / (view.end - view.first), perColumn = this.seconds * this.rate;
    for (const [first, last] of own) {
      const a = Math.max(0, (first / perColumn - view.first) * scale), b = Math.min(view.wide, ((last + 1) / perColumn - view.first) * scale);
      if (b > 0 && a < view.wide) this.context.fillRect(view.left + a, y + 1, Math.max(1, b - a), tall - 3);
    }
  }

  label(channel, y, tall, range) {
    const { context, colour } = this, { name, unit } = this.channels[channel];
    context.textBaseline = "middle";
    context.textAlign = "left";
    context.font = "12.5px system-ui, sans-serif";
    context.fillStyle = colour.ink;
    const sign = unit ? ` [${unit.replace(/\^2/g, "²")}]` : "";
    const text = this.cut(name, LABEL - 54 - context.measureText(sign).width) + sign;
    context.fillText(text, 2, y + tall / 2);
    if (!range) return;
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "right";
    context.fillStyle = colour.muted;
    context.fillText(short(range[1]), LABEL - 6, y + 8);
    context.fillText(short(range[0]), LABEL - 6, y + tall - 9);
  }

  cut(text, wide) {
    if (this.context.measureText(text).width <= wide) return text;
    while (text.length > 1 && this.context.measureText(`${text}…`).width > wide) text = text.slice(0, -1);
    return `${text}…`;
  }
}

// A number in at most six characters.
export function short(value) {
  const size = Math.abs(value);
  if (size !== 0 && (size < 0.01 || size >= 1e5)) return value.toExponential(0).replace("e+", "e");
  return value.toFixed(size < 1 ? 3 : size < 10 ? 2 : size < 100 ? 1 : 0);
}
