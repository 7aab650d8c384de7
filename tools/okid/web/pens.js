// SPDX-License-Identifier: MIT
// Pens that shapes.js draws with, on a canvas or as SVG, and the pictures that are saved: GIF, PNG, SVG. Needs selection.js.
//
//   okidPens.save(view, canvas, "gif", "shape")   the view of okidShapes() as it is turned now, into a file of the reader
"use strict";

const okidPens = {
  canvas(context) {
    const path = (points) => points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.font = "12px system-ui, sans-serif";
    return {
      wide: (text) => context.measureText(text).width,
      face(points, colour, share) {
        context.globalAlpha = share;
        context.fillStyle = colour;
        context.beginPath();
        path(points);
        context.fill();
        context.globalAlpha = 1;
      },
      lines(pairs, colour, thick, dash) {
        context.strokeStyle = colour;
        context.lineWidth = thick;
        context.setLineDash(dash);
        context.beginPath();
        pairs.forEach(path);
        context.stroke();
        context.setLineDash([]);
      },
      dot([x, y], radius, fill, edge) {
        context.fillStyle = fill;
        context.strokeStyle = edge;
        context.lineWidth = 1.2;
        context.beginPath();
        context.arc(x, y, radius, 0, 2 * Math.PI);
        context.fill();
        context.stroke();
      },
      text(text, x, y, colour) {
        context.fillStyle = colour;
        context.fillText(text, x, y);
      },
    };
  },

  // The same strokes as text; `parts` grows.
  svg(parts, wide) {
    const plain = (text) => String(text).replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`).replace(/[\0-\x08\x0b-\x1f]/g, "\ufffd");
    const at = ([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`;
    return {
      wide,
      face: (points, colour, share) => parts.push(`<path d="M${points.map(at).join("L")}Z" fill="${plain(colour)}" fill-opacity="${share}"/>`),
      lines(pairs, colour, thick, dash) {
        const d = pairs.map((pair) => `M${pair.map(at).join("L")}`).join("");
        parts.push(`<path d="${d}" fill="none" stroke="${plain(colour)}" stroke-width="${thick}"${dash.length ? ` stroke-dasharray="${dash.join(" ")}"` : ""}/>`);
      },
      dot: ([x, y], radius, fill, edge) => parts.push(
        `<circle cx="${x.toFixed(2)}" cy="${y.toFixed(2)}" r="${radius}" fill="${plain(fill)}" stroke="${plain(edge)}" stroke-width="1.2"/>`),
      text: (text, x, y, colour) => parts.push(
        `<text x="${x.toFixed(2)}" y="${y.toFixed(2)}" fill="${plain(colour)}" font-family="sans-serif" font-size="12">${plain(text)}</text>`),
    };
  },

  // Frames of one size (ImageData) as the bytes of a GIF that repeats for ever; `delay` of each in 1/100 s.
  gif(frames, delay) {
    const { width, height } = frames[0], out = [], word = (value) => out.push(value & 255, (value >> 8) & 255);
    const key = (data, k) => ((data[k] >> 3) << 10) | ((data[k + 1] >> 3) << 5) | (data[k + 2] >> 3);
    const often = new Map(); // colours to five bits each
    for (const { data } of frames) for (let k = 0; k < data.length; k += 4) often.set(key(data, k), (often.get(key(data, k)) || 0) + 1);
    const chosen = [...often].sort((a, b) => b[1] - a[1] || a[0] - b[0]).slice(0, 256).map(([one]) => one);
    const parts = (one) => [one >> 10, (one >> 5) & 31, one & 31], palette = chosen.map(parts), index = new Map(chosen.map((one, k) => [one, k]));
    function nearest(one) {
      if (!index.has(one)) {
        const far = ([r, g, b]) => (r - parts(one)[0]) ** 2 + (g - parts(one)[1]) ** 2 + (b - parts(one)[2]) ** 2;
        index.set(one, palette.reduce((best, colour, k) => (far(colour) < far(palette[best]) ? k : best), 0));
      }
      return index.get(one);
    }
    out.push(...[..."GIF89a"].map((letter) => letter.charCodeAt(0)));
    word(width);
    word(height);
    out.push(0xf7, 0, 0); // a table of 256 colours for all frames
    for (let k = 0; k < 256; k++) for (const part of palette[k] || [0, 0, 0]) out.push((part << 3) | (part >> 2));
    out.push(0x21, 0xff, 11, ...[..."NETSCAPE2.0"].map((letter) => letter.charCodeAt(0)), 3, 1, 0, 0, 0);
    for (const { data } of frames) {
      out.push(0x21, 0xf9, 4, 0);
      word(delay);
      out.push(0, 0, 0x2c);
      for (const value of [0, 0, width, height]) word(value);
      out.push(0, 8);
      const pixels = new Uint8Array(data.length / 4);
      for (let k = 0; k < pixels.length; k++) pixels[k] = nearest(key(data, 4 * k));
      const bytes = okidPens.lzw(pixels);
      for (let k = 0; k < bytes.length; k += 255) {
        const piece = bytes.slice(k, k + 255);
        out.push(piece.length, ...piece);
      }
      out.push(0);
    }
    out.push(0x3b);
    return new Uint8Array(out);
  },

  // Numbers of eight bits in the variable codes of GIF: 256 clears the table, 257 ends.
  lzw(pixels) {
    const out = [];
    let bits = 0, have = 0, size = 9, next = 258, table = new Map(), code = pixels[0];
    function put(value) {
      bits |= value << have;
      have += size;
      for (; have >= 8; have -= 8, bits >>>= 8) out.push(bits & 255);
    }
    put(256);
    for (let k = 1; k < pixels.length; k++) {
      const longer = (code << 8) | pixels[k];
      if (table.has(longer)) {
        code = table.get(longer);
        continue;
      }
      put(code);
      if (next < 4096) {
        if (next === 1 << size && size < 12) size += 1;
        table.set(longer, next++);
      } else {
        put(256);
        [size, next, table] = [9, 258, new Map()];
      }
      code = pixels[k];
    }
    put(code);
    if (next === 1 << size && size < 12) size += 1; // a reader has grown its table by now
    put(257);
    if (have > 0) out.push(bits & 255);
    return out;
  },

  // A canvas of the same picture on the colour of the page.
  still(view, width, height, ratio, ground, phase) {
    const sheet = document.createElement("canvas"), context = sheet.getContext("2d", { willReadFrequently: true });
    [sheet.width, sheet.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = ground;
    context.fillRect(0, 0, width, height);
    view.paint(okidPens.canvas(context), width, height, phase);
    return sheet;
  },

  async save(view, canvas, kind, name) {
    const width = canvas.clientWidth, height = canvas.clientHeight, style = getComputedStyle(canvas);
    const ground = style.getPropertyValue("--paper").trim() || style.getPropertyValue("--panel").trim() || "white";
    let blob;
    if (kind === "svg") {
      const context = document.createElement("canvas").getContext("2d"), parts = [];
      view.paint(okidPens.svg(parts, okidPens.canvas(context).wide), width, height, view.phase);
      const head = `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}">`;
      blob = new Blob([`${head}<rect width="100%" height="100%" fill="${ground}"/>${parts.join("\n")}</svg>\n`], { type: "image/svg+xml" });
    } else if (kind === "png") {
      blob = await new Promise((done) => okidPens.still(view, width, height, 2, ground, view.phase).toBlob(done, "image/png"));
    } else {
      const count = 24, ratio = Math.min(1, 720 / width), frames = [];
      for (let k = 0; k < count; k++) {
        const sheet = okidPens.still(view, width, height, ratio, ground, (2 * Math.PI * k) / count);
        frames.push(sheet.getContext("2d").getImageData(0, 0, sheet.width, sheet.height));
      }
      blob = new Blob([okidPens.gif(frames, Math.round((100 * view.period) / count))], { type: "image/gif" });
    }
    okidSelection.save(`${name}.${kind}`, blob.type, blob);
  },
};
window.okidPens = okidPens;
