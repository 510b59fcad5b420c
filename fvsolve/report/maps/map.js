"use strict";
// Maps: packed rasters are painted on a canvas, whose picture lies below the outlines that Plotly draws.
// Each raster has a level in each pixel: 0 for none, else 1 + k each + j for part j of `each` of class k.
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

  const drawMap = async (id) => {
    const plot = chart(id), { map } = figures[id], { width, height, extent, frames } = map;
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d"), image = context.createImageData(width, height);
    const shade = await unpacked(map.shade);
    const layers = [];
    for (const layer of map.layers) layers.push({ ...layer, levels: await unpacked(layer.data) });
    const series = [];
    for (const text of frames ? frames.data : []) {
      const levels = await unpacked(text), before = series.at(-1);
      if (before) for (let i = 0; i < levels.length; i++) levels[i] ^= before[i];
      series.push(levels);
    }

    const painted = (levels, { colours, each }) => {
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
      return {
        source: canvas.toDataURL(), xref: "x", yref: "y", layer: "below", sizing: "stretch",
        x: extent[0], y: extent[3], sizex: extent[1] - extent[0], sizey: extent[3] - extent[2],
      };
    };

    // Legend: classes of the layer in view, with the flooded area of each.
    const figure = plot.closest("figure"), box = figure.querySelector(".classes"), note = figure.querySelector(".source");
    const legend = (layer) => {
      const title = document.createElement("span");
      title.textContent = `${layer.name} [${layer.unit}]`;
      const entries = layer.texts.map((text, k) => {
        const entry = document.createElement("span"), swatch = document.createElement("i");
        swatch.style.background = layer.colours[k];
        entry.append(swatch, layer.areas ? `${text} (${layer.areas[k]})` : text);
        return entry;
      });
      box.replaceChildren(title, ...entries);
      note.textContent = layer.source ?? "";
    };
    let view = { levels: layers[0].levels, layer: layers[0] };
    const show = (levels, layer) => {
      view = { levels, layer };
      return Plotly.relayout(plot, { images: [painted(levels, layer)] });
    };

    // A click on a cell shows its values over time; the pointer shows the value below it.
    const pixelAt = (event) => {
      const { xaxis, yaxis } = plot._fullLayout, place = plot.getBoundingClientRect();
      const x = xaxis.p2d(event.clientX - place.left - xaxis._offset);
      const y = yaxis.p2d(event.clientY - place.top - yaxis._offset);
      const i = Math.floor((x - extent[0]) / (extent[1] - extent[0]) * width);
      const j = Math.floor((extent[3] - y) / (extent[3] - extent[2]) * height);
      return i >= 0 && i < width && j >= 0 && j < height ? { x, y, at: j * width + i } : null;
    };
    const reading = figure.querySelector(".reading"), cell = figure.querySelector(".cell");
    plot.addEventListener("mousemove", (event) => {
      const pixel = pixelAt(event);
      if (!pixel) return reading.textContent = "";
      const value = valueOf(view.levels[pixel.at], view.layer);
      const text = value === null ? "" : `: ${numberText(value)} ${view.layer.unit}`;
      reading.textContent = `${pixel.x.toFixed(1)}, ${pixel.y.toFixed(1)}${text}`;
    });
    let pressed = null;
    plot.addEventListener("mousedown", (event) => { pressed = event; }, true);
    plot.addEventListener("mouseup", (event) => {
      if (!pressed || Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) > 4) return;
      const pixel = pixelAt(event);
      if (!pixel || !series.length || !plot.contains(pressed.target)) return;
      const values = series.map((levels) => valueOf(levels[pixel.at], frames) ?? (shade[pixel.at] ? 0 : null));
      cell.hidden = false;
      const layout = structuredClone(map.cell.layout);
      layout.title = { text: `${frames.name} at ${pixel.x.toFixed(1)}, ${pixel.y.toFixed(1)}`, font: { size: 13 } };
      const line = { type: "scatter", mode: "lines", x: frames.times, y: values, line: { color: "#0b6aa8", width: 1.8 } };
      Plotly.react(cell, [line], layout, { responsive: true, displaylogo: false, displayModeBar: false });
      Plotly.restyle(plot, { x: [[pixel.x]], y: [[pixel.y]] }, [plot.data.length - 1]);
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
        return `t = ${numberText(frames.times[k])} ${map.clock}`;
      }, false);
    }

    // Scale bar and north arrow follow the zoom.
    const bar = figure.querySelector(".scale");
    const rescale = () => {
      const { xaxis, yaxis } = plot._fullLayout, pixel = (xaxis.range[1] - xaxis.range[0]) / xaxis._length;
      const longest = 0.28 * xaxis._length * pixel, power = 10 ** Math.floor(Math.log10(longest));
      const length = [5, 2, 1].find((step) => step * power <= longest) * power;
      bar.style.width = `${length / pixel}px`;
      bar.style.left = `${xaxis._offset + 12}px`;
      bar.style.top = `${yaxis._offset + yaxis._length - 34}px`;
      bar.textContent = length >= 1000 ? `${length / 1000} km` : `${length} m`;
      const north = figure.querySelector(".north");
      if (!north) return;
      north.style.left = `${xaxis._offset + xaxis._length - 34}px`;
      north.style.top = `${yaxis._offset + 8}px`;
    };
    plot.on("plotly_afterplot", rescale);
    rescale();
    await buttons[0].onclick();
    return buttons[0];
  };
  return Promise.all(Object.keys(figures).filter((id) => figures[id].map).map(drawMap));
};
