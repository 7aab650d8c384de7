// SPDX-License-Identifier: MIT
// Mode shapes that move, on a canvas: no library, nothing from outside.
//
//   const view = okidShapes(canvas, {nodes, lines, dofs, names}, shapes);
//
// nodes   [[x, y, z], ...]           metres or anything else, z is up
// lines   [[1, 2], ...]              pairs of nodes, counted from 1
// dofs    [[node, "x"], ...]         one for each entry of a shape: where it is and which way it counts: x y z -x -y -z
//                                    (null: this entry is not on the picture)
// names   ["a1", ...]                one for each entry, written beside its node; optional
// shapes  [{re: [...], im: [...]}, ...]   one for each mode, largest entry 1; im may be missing; null: not measured, the
//                                    node is then not drawn
//
// view.show(k)    mode k, counted from 0; outside of the list: the structure at rest
// view.play()     move (also the space bar on the canvas); view.pause() stops where it is
// view.set(shapes, geometry)   new shapes of the same or of another geometry (live page); keeps the angle of view
// view.playing, view.mode      what is on
//
// Drag or arrow keys turn the picture, + and - bring it nearer, Home is the first view. Colours are the CSS variables
// --ink (names), --muted (at rest), --accent (the shape) of the canvas, read at each frame: a page that turns dark takes
// the picture with it. Starts at rest when the reader asked for less motion (prefers-reduced-motion).
"use strict";

function okidShapes(canvas, geometry, shapes) {
  const PERIOD_S = 1.6, SWING = 0.16; // one turn of the motion; largest displacement over the size of the structure
  const FIRST = { yaw: -0.6, pitch: 0.35, zoom: 1 };
  const context = canvas.getContext("2d");
  let nodes, lines, dofs, names, centre, size, flat;
  let mode = 0, phase = 0, playing = false, before = 0, view = { ...FIRST }, held = null;

  function take(one) {
    nodes = one.nodes.length ? one.nodes : [[0, 0, 0]];
    lines = one.lines || [];
    dofs = one.dofs || [];
    names = one.names || [];
    const span = [0, 1, 2].map((k) => [Math.min(...nodes.map((n) => n[k])), Math.max(...nodes.map((n) => n[k]))]);
    centre = span.map(([low, high]) => (low + high) / 2);
    size = Math.hypot(...span.map(([low, high]) => high - low)) || 1;
    flat = span[1][0] === span[1][1]; // a drawing in the x-z plane is best seen from its front
    FIRST.yaw = flat ? 0 : -0.6;
    FIRST.pitch = flat ? 0 : 0.35;
  }

  // Displacement of every node at this phase: Re(shape exp(i phase)) along the direction of each entry.
  function moved(at) {
    const out = nodes.map((n) => n.slice());
    const shape = shapes[mode];
    if (!shape) return out;
    dofs.forEach((dof, k) => {
      if (!dof || !out[dof[0] - 1] || !Number.isFinite(shape.re[k])) return;
      const imaginary = shape.im && Number.isFinite(shape.im[k]) ? shape.im[k] : 0;
      const axis = "xyz".indexOf(dof[1].slice(-1)), sign = dof[1][0] === "-" ? -1 : 1;
      out[dof[0] - 1][axis] += sign * SWING * size * (shape.re[k] * Math.cos(at) - imaginary * Math.sin(at));
    });
    return out;
  }

  // Nodes of which this mode has no value (null): it was not measured there.
  function unknown() {
    const out = new Set(), known = new Set(), shape = shapes[mode];
    if (!shape) return out;
    dofs.forEach((dof, k) => { if (dof) (Number.isFinite(shape.re[k]) ? known : out).add(dof[0]); });
    known.forEach((node) => out.delete(node));
    return out;
  }

  // Orthographic: turned about z, then tilted; y of the screen points down.
  function projected(points, width, height) {
    const scale = (view.zoom * Math.min(width, height)) / (size * 1.2);
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    return points.map((p) => {
      const [x, y, z] = p.map((value, k) => value - centre[k]);
      const depth = x * sy + y * cy;
      return [width / 2 + scale * (x * cy - y * sy), height / 2 - scale * (z * cp + depth * sp)];
    });
  }

  function strokes(points, colour, thick, dash, without = new Set()) {
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = thick;
    context.setLineDash(dash);
    context.beginPath();
    for (const [a, b] of lines) {
      if (!points[a - 1] || !points[b - 1] || without.has(a) || without.has(b)) continue;
      context.moveTo(...points[a - 1]);
      context.lineTo(...points[b - 1]);
    }
    context.stroke();
    context.setLineDash([]);
  }

  function dots(points, radius, without) {
    for (const [k, [x, y]] of points.entries()) {
      if (without.has(k + 1)) continue;
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.fill();
    }
  }

  // Names of all entries of a node in one line, at its place at rest; written only where no other name stands.
  function labels(points, colour, width) {
    const written = [], texts = new Map();
    dofs.forEach((dof, k) => {
      if (dof && names[k]) texts.set(dof[0] - 1, (texts.has(dof[0] - 1) ? texts.get(dof[0] - 1) + ", " : "") + names[k]);
    });
    context.fillStyle = colour;
    context.font = "12px system-ui, sans-serif";
    for (const [node, full] of texts) {
      const text = full.length > 24 ? full.slice(0, 23) + "…" : full;
      if (!points[node]) continue;
      const wide = context.measureText(text).width, x = Math.min(points[node][0] + 8, width - wide - 4), y = points[node][1] - 7;
      if (written.some(([a, b, w]) => x < a + w + 4 && a < x + wide + 4 && Math.abs(y - b) < 14)) continue;
      written.push([x, y, wide]);
      context.fillText(text, x, y);
    }
  }

  function draw() {
    const width = canvas.clientWidth, height = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    if (!width || !height) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const style = getComputedStyle(canvas);
    const colour = (name, other) => style.getPropertyValue(name).trim() || other;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const still = projected(nodes, width, height), now = projected(moved(phase), width, height);
    strokes(still, colour("--muted", "gray"), 1, [4, 4]);
    const without = unknown();
    strokes(now, colour("--accent", "blue"), 2.5, [], without);
    dots(now, nodes.length > 60 ? 2 : 4, without);
    labels(still, colour("--ink", "black"), width);
  }

  function frame(time) {
    if (!playing) return;
    phase = (phase + (2 * Math.PI * Math.min(0.1, (time - before) / 1000)) / PERIOD_S) % (2 * Math.PI);
    before = time;
    draw();
    requestAnimationFrame(frame);
  }

  function changed() {
    canvas.dispatchEvent(new Event("okid-shapes")); // the page may want to change the word on its button
    draw();
  }

  const api = {
    show(k) { mode = k; if (!playing) phase = 0; changed(); },
    play() {
      if (playing) return;
      playing = true;
      before = performance.now();
      requestAnimationFrame(frame);
      changed();
    },
    pause() { playing = false; changed(); },
    set(others, another) { shapes = others; if (another) take(another); draw(); },
    get playing() { return playing; },
    get mode() { return mode; },
  };

  canvas.addEventListener("pointerdown", (event) => {
    held = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    turn((event.clientX - held[0]) * 0.01, (event.clientY - held[1]) * 0.01);
    held = [event.clientX, event.clientY];
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });

  function turn(yaw, pitch) {
    view.yaw += yaw;
    view.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.pitch + pitch));
    draw();
  }

  const keys = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1), ArrowDown: () => turn(0, 0.1),
    "+": () => { view.zoom = Math.min(8, view.zoom * 1.15); draw(); }, "-": () => { view.zoom = Math.max(0.2, view.zoom / 1.15); draw(); },
    Home: () => { view = { ...FIRST }; draw(); }, " ": () => (playing ? api.pause() : api.play()),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    keys[event.key]();
    event.preventDefault();
  });

  take(geometry);
  view = { ...FIRST };
  new ResizeObserver(draw).observe(canvas);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) draw();
  else api.play();
  return api;
}
