"use strict";
// Maps: values in levels of one byte are unpacked and painted, as pixels of a basin or as pieces of the pipes of a network.
// A level is 0 for no value, else 1 + k each + j for part j of `each` of class k.
const MAP_MARGINS = [82, 76], MAP_HEIGHTS = [150, 640];  // sum of the margins of a map, least and greatest height [px]
const mapHeight = ({ map: { extent } }, width) => {
  const height = (width - MAP_MARGINS[0]) * (extent[3] - extent[2]) / (extent[1] - extent[0]);
  return Math.round(Math.min(Math.max(height, MAP_HEIGHTS[0]), MAP_HEIGHTS[1])) + MAP_MARGINS[1];
};
const drawMaps = ({ figures, chart, addPlayer, numberText }) => {
  const unpacked = async (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  };
  const rgb = (colour) => [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
  const valueOf = (level, { limits, each }) => {
    if (level === 0) return null;
    const k = Math.floor((level - 1) / each), part = (level - 1) % each;
    return limits[k] + (part + 0.5) / each * (limits[k + 1] - limits[k]);
  };
  const pointAt = (plot, event) => {
    const { xaxis, yaxis } = plot._fullLayout, place = plot.getBoundingClientRect();
    return [xaxis.p2d(event.clientX - place.left - xaxis._offset), yaxis.p2d(event.clientY - place.top - yaxis._offset)];
  };

  // Pixels: a picture on a canvas, below the outlines that Plotly draws.
  const pixelPainter = async (plot, { width, height, extent, shade: text }) => {
    const canvas = document.createElement("canvas"), shade = await unpacked(text);
    [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d"), image = context.createImageData(width, height);
    const place = {
      xref: "x", yref: "y", layer: "below", sizing: "stretch",
      x: extent[0], y: extent[3], sizex: extent[1] - extent[0], sizey: extent[3] - extent[2],
    };
    const paint = (levels, { colours, each }) => {
      const palette = colours.map(rgb), pixels = image.data;
      for (let i = 0; i < levels.length; i++) {
        const light = (shade[i] - 1) / 254, at = 4 * i;
        const colour = levels[i] ? palette[Math.floor((levels[i] - 1) / each)] : null;
        const dim = 0.45 + 0.55 * light;
        pixels[at] = colour ? dim * colour[0] : 255 * light;
        pixels[at + 1] = colour ? dim * colour[1] : 255 * light;
        pixels[at + 2] = colour ? dim * colour[2] : 252 * light;
        pixels[at + 3] = shade[i] ? 255 : 0;
      }
      context.putImageData(image, 0, 0);
      return Plotly.relayout(plot, { images: [{ source: canvas.toDataURL(), ...place }] });
    };
    const find = (x, y) => {
      const i = Math.floor((x - extent[0]) / (extent[1] - extent[0]) * width);
      const j = Math.floor((extent[3] - y) / (extent[3] - extent[2]) * height);
      if (i < 0 || i >= width || j < 0 || j >= height) return null;
      return { x, y, at: j * width + i, empty: shade[j * width + i] ? 0 : null, name: `${x.toFixed(1)}, ${y.toFixed(1)}` };
    };
    return { paint, find };
  };

  // Pieces of pipes: a line for each class.
  const piecePainter = async (plot, { lines, extent }) => {
    const middle = 0.5 * (extent[0] + extent[1]);
    const numbers = ({ bdata }) => new Float64Array(Uint8Array.from(atob(bdata), (letter) => letter.charCodeAt(0)).buffer);
    const x = numbers(lines.x), y = numbers(lines.y), { pipe, names, classes } = lines;
    const worst = plot.data.length - 2;
    const paint = (levels, { colours, each, worst: place }) => {
      const across = Array.from({ length: classes }, () => []), along = Array.from({ length: classes }, () => []);
      for (let i = 0, before = -1; i < levels.length; i++) {
        const k = levels[i] ? Math.floor((levels[i] - 1) / each) : -1;
        if (k >= 0) {
          if (k !== before || pipe[i] !== pipe[i - 1]) {
            across[k].push(null, x[2 * i]);
            along[k].push(null, y[2 * i]);
          }
          across[k].push(x[2 * i + 1]);
          along[k].push(y[2 * i + 1]);
        }
        before = k;
      }
      const shown = Array.from({ length: classes }, (_, k) => colours[k] ?? "#000000");
      const change = {
        x: [...across, [place ? place.x : null]], y: [...along, [place ? place.y : null]],
        "line.color": [...shown, "#000000"], text: [...Array(classes).fill(null), [place ? place.text : ""]],
        textposition: [...Array(classes).fill("top center"), place && place.x > middle ? "bottom left" : "bottom right"],
      };
      return Plotly.restyle(plot, change, [...Array(classes).keys(), worst]);
    };
    const find = (px, py) => {
      let best = null, least = Infinity;
      for (let i = 0; i < pipe.length; i++) {
        const [ax, ay, bx, by] = [x[2 * i], y[2 * i], x[2 * i + 1], y[2 * i + 1]];
        const length = (bx - ax) ** 2 + (by - ay) ** 2;
        const share = length ? Math.min(Math.max(((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / length, 0), 1) : 0;
        const cx = ax + share * (bx - ax), cy = ay + share * (by - ay), away = (cx - px) ** 2 + (cy - py) ** 2;
        if (away < least) [best, least] = [{ x: cx, y: cy, at: i, empty: null, name: names[pipe[i]] }, away];
      }
      const { xaxis } = plot._fullLayout, reach = 12 * (xaxis.range[1] - xaxis.range[0]) / xaxis._length;
      return Math.sqrt(least) <= reach ? best : null;
    };
    return { paint, find };
  };

  const drawMap = async (id) => {
    const plot = chart(id), { map } = figures[id], { frames } = map;
    const painter = await (map.lines ? piecePainter : pixelPainter)(plot, map);
    const layers = [];
    for (const layer of map.layers) layers.push({ ...layer, levels: await unpacked(layer.data) });
    const series = [];
    for (const text of frames ? frames.data : []) {
      const levels = await unpacked(text), before = series.at(-1);
      if (before) for (let i = 0; i < levels.length; i++) levels[i] ^= before[i];
      series.push(levels);
    }

    // Legend: classes of the layer in view, with the area of each.
    const figure = plot.closest("figure"), box = figure.querySelector(".classes"), note = figure.querySelector(".source");
    const legend = (layer) => {
      const title = document.createElement("span");
      title.textContent = `${layer.name} [${layer.unit}]`;
      const entries = layer.texts.map((text, k) => {
        const entry = document.createElement("span"), swatch = document.createElement("i");
        swatch.style.background = layer.colours[k];
        entry.append(swatch, layer.amounts ? `${text} (${layer.amounts[k]})` : text);
        return entry;
      });
      box.replaceChildren(title, ...entries);
      note.textContent = layer.source ?? "";
    };
    let view = { levels: layers[0].levels, layer: layers[0] };
    const show = (levels, layer) => {
      view = { levels, layer };
      return painter.paint(levels, layer);
    };

    // The pointer shows the value below it; a click shows the values there over time.
    const reading = figure.querySelector(".reading"), cell = figure.querySelector(".cell");
    plot.addEventListener("mousemove", (event) => {
      const place = painter.find(...pointAt(plot, event));
      const value = place ? valueOf(view.levels[place.at], view.layer) : null;
      reading.textContent = !place ? "" : value === null ? place.name : `${place.name}: ${numberText(value)} ${view.layer.unit}`;
    });
    let pressed = null;
    plot.addEventListener("pointerdown", (event) => { pressed = event; }, true);
    // while the map is dragged, an element of Plotly above the page receives the events
    addEventListener("pointerup", (event) => {
      if (!pressed || Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) > 4) return pressed = null;
      const place = painter.find(...pointAt(plot, pressed));
      pressed = null;
      if (!place) return;
      Plotly.restyle(plot, { x: [[place.x]], y: [[place.y]] }, [plot.data.length - 1]);
      if (!series.length) return;
      const values = series.map((levels) => valueOf(levels[place.at], frames) ?? place.empty);
      cell.hidden = false;
      const layout = structuredClone(map.cell.layout);
      layout.title = { text: `${frames.name} at ${place.name}`, font: { size: 13 } };
      const line = { type: "scatter", mode: "lines", x: frames.times, y: values, line: { color: "#0b6aa8", width: 1.8 } };
      Plotly.react(cell, [line], layout, { responsive: true, displaylogo: false, displayModeBar: false });
    }, true);

    // Buttons choose a layer of greatest values; the slider shows the frames.
    const choices = figure.querySelector(".layers");
    const chosen = (button) => {
      for (const other of choices.children) other.setAttribute("aria-pressed", other === button);
    };
    const buttons = layers.map((layer) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = layer.name;
      button.onclick = () => {
        chosen(button);
        legend(layer);
        return show(layer.levels, layer);
      };
      return button;
    });
    choices.append(...buttons);
    if (series.length) {
      const button = document.createElement("button"), player = figure.querySelector(".player");
      button.type = "button";
      button.textContent = `${frames.name} over time`;
      button.onclick = () => player.children[1].dispatchEvent(new Event("input"));
      choices.append(button);
      addPlayer(player, frames.seconds, (k) => {
        if (button.getAttribute("aria-pressed") !== "true") {
          chosen(button);
          legend({ ...frames, source: `Values of ${series.length} of ${frames.stored} stored frames.` });
        }
        show(series[k], frames);
        return frames.dates ? frames.dates[k] : `t = ${numberText(frames.times[k])} ${map.clock}`;
      }, false);
    }

    // Scale bar and north arrow follow the zoom.
    const bar = figure.querySelector(".scale"), north = figure.querySelector(".north");
    const rescale = () => {
      const { xaxis, yaxis } = plot._fullLayout, pixel = (xaxis.range[1] - xaxis.range[0]) / xaxis._length;
      const longest = 0.28 * xaxis._length * pixel, power = 10 ** Math.floor(Math.log10(longest));
      const length = [5, 2, 1].find((step) => step * power <= longest) * power;
      if (bar) {
        bar.style.width = `${length / pixel}px`;
        bar.style.left = `${xaxis._offset + 12}px`;
        bar.style.top = `${yaxis._offset + yaxis._length - 34}px`;
        bar.textContent = length >= 1000 ? `${length / 1000} km` : `${numberText(length)} m`;
      }
      if (north) {
        north.style.left = `${xaxis._offset + xaxis._length - 34}px`;
        north.style.top = `${yaxis._offset + 8}px`;
      }
    };
    plot.on("plotly_afterplot", rescale);
    rescale();
    await buttons[0].onclick();
  };
  return Promise.all(Object.keys(figures).filter((id) => figures[id].map).map(drawMap));
};
