"use strict";
(() => {
  const figures = JSON.parse(document.getElementById("figures").textContent), { scene } = figures;
  delete figures.scene;  // pictures, which Plotly does not draw
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
  const ids = Object.keys(figures), histories = ids.filter((id) => id.startsWith("history-"));
  const chart = (id) => document.getElementById(id);
  const { decimal } = document.documentElement.dataset;
  const numberText = (value) => Number(value.toPrecision(4)).toString().replace(".", decimal);
  const WIDE = 680;  // width of a printed page [px]

  // On touch screens a chart is zoomed by its buttons; on a narrow page names that would overlap are left out.
  const touched = matchMedia("(pointer: coarse)").matches;
  if (touched) config.displayModeBar = true;
  for (const [id, { layout }] of Object.entries(figures)) {
    if (touched) layout.dragmode = false;
    if (figures[id].map) layout.height = mapHeight(figures[id], chart(id).clientWidth);
    if (!layout.annotations || figures[id].map) continue;
    const pixel = (layout.xaxis.range[1] - layout.xaxis.range[0]) / (Math.min(chart(id).clientWidth, WIDE) - 76);
    const begin = ({ x, xanchor, text }) => x - (xanchor === "right" ? 4.3 * pixel * Math.max(...text.split("<br>").map((line) => line.length)) : 0);
    const kept = layout.annotations.filter((name) => name.showarrow);
    for (const name of layout.annotations)
      if (!name.showarrow && kept.every((one) => one.showarrow || Math.abs(begin(one) - begin(name)) >= 24 * pixel)) kept.push(name);
    layout.annotations = kept;
  }

  // The legend is above its chart, where it covers no line at any width of the page.
  const swatch = ({ mode, line, marker }) => mode === "markers"
    ? `<b style="color:${marker.line?.color ?? marker.color}">${{ square: "\u25a0", "x-thin": "\u00d7" }[marker.symbol] ?? "\u2022"}</b>`
    : `<svg width="30" height="8"><line x2="30" y1="4" y2="4" stroke="${line.color}" stroke-width="${line.width}"`
      + ` stroke-dasharray="${line.dash === "solid" ? "" : line.dash.replaceAll("px", "")}"/></svg>`;
  const legend = (id) => {
    if (figures[id].map) return;  // a map has classes
    const box = chart(id).previousElementSibling, traces = chart(id).data;
    box.replaceChildren(...traces.flatMap((trace) => {
      if (trace.showlegend === false || trace.visible === false) return [];
      const button = document.createElement("button"), seen = trace.visible !== "legendonly";
      button.type = "button";
      button.setAttribute("aria-pressed", seen);
      button.innerHTML = swatch(trace) + trace.name;  // texts of the case were escaped for Plotly
      button.onclick = () => {
        const own = (one) => one === trace || (trace.legendgroup && one.legendgroup === trace.legendgroup);
        Plotly.restyle(chart(id), { visible: seen ? "legendonly" : true }, [...traces.keys()].filter((k) => own(traces[k])));
        legend(id);
      };
      return [button];
    }));
  };

  const light = JSON.parse(document.documentElement.dataset.dark);
  const dark = Object.fromEntries(Object.entries(light).map(([one, other]) => [other, one]));
  const screen = matchMedia("(prefers-color-scheme: dark)");
  const paint = (node, colours) => {
    for (const [key, value] of Object.entries(node))
      if (typeof value === "string" && /color$/.test(key)) node[key] = colours[value] ?? value;
      else if (value && typeof value === "object" && !ArrayBuffer.isView(value)) paint(value, colours);
  };
  const repaint = (is_dark) => {
    for (const id of ids) {
      for (const part of [chart(id).data, chart(id).layout]) paint(part, is_dark ? light : dark);
      Plotly.redraw(chart(id));
      legend(id);
    }
  };
  if (screen.matches) for (const one of Object.values(figures)) paint(one, light);

  const drawn = ids.map((id) => {
    if (figures[id].map) return Plotly.newPlot(chart(id), figures[id].data, figures[id].layout, { ...config, scrollZoom: true });
    chart(id).insertAdjacentHTML("beforebegin", '<div class="legend"></div>');
    return Plotly.newPlot(chart(id), figures[id].data, figures[id].layout, config);
  });
  ids.forEach(legend);
  screen.addEventListener("change", () => repaint(screen.matches));

  let width = innerWidth;
  addEventListener("resize", () => {
    if (innerWidth === width) return;
    width = innerWidth;
    for (const id of ids.filter((id) => figures[id].map))
      Plotly.relayout(chart(id), { height: heights[id] = mapHeight(figures[id], chart(id).clientWidth) });
  });

  // All histories have the same time axis: a zoom in a chart applies to all.
  let following = false;
  for (const id of histories) {
    chart(id).on("plotly_relayout", (change) => {
      const axis = chart(id).layout.xaxis;
      if (following || !("xaxis.range[0]" in change || "xaxis.autorange" in change)) return;
      following = true;
      const range = [...axis.range];
      const others = histories.filter((other) => other !== id);
      Promise.all(others.map((other) => Plotly.relayout(chart(other), { "xaxis.range": range })))
        .finally(() => { following = false; });
    });
  }

  // Players: a slider with a button. All of them show the same time, or their nearest time to it.
  const players = [];
  const addPlayer = (player, seconds, show, first = true) => {
    const [button, slider, output] = player.children;
    const pause = Math.max(40, Math.min(400, 8000 / seconds.length));
    let timer = null;
    const to = (k) => {
      slider.value = k;
      output.textContent = show(k);
    };
    const own = {
      follow: (time) => {
        let k = 0;
        while (k < seconds.length - 1 && Math.abs(seconds[k + 1] - time) <= Math.abs(seconds[k] - time)) k++;
        if (k !== Number(slider.value)) to(k);
      },
    };
    players.push(own);
    const move = (k) => {
      to(k);
      for (const other of players) if (other !== own) other.follow(seconds[k]);
    };
    const stop = () => {
      clearInterval(timer);
      timer = null;
      button.textContent = "Play";
    };
    button.addEventListener("click", () => {
      if (timer !== null) return stop();
      if (Number(slider.value) >= seconds.length - 1) move(0);
      button.textContent = "Pause";
      timer = setInterval(() => {
        move(Number(slider.value) + 1);
        if (Number(slider.value) >= seconds.length - 1) stop();
      }, pause);
    });
    slider.addEventListener("input", () => { stop(); move(Number(slider.value)); });
    if (first) to(0);
  };
  for (const player of document.querySelectorAll(".player[data-for]")) {
    const id = player.dataset.for, { trace, times, heads, dates } = figures[id].moving;
    addPlayer(player, times, (k) => {
      Plotly.restyle(chart(id), { y: [heads[k]] }, [trace]);
      return dates ? dates[k] : `t = ${numberText(times[k])} s`;
    });
  }
  if (scene) {
    const picture = document.querySelector("img.scene"), { times, dates } = scene.moving;
    addPlayer(document.getElementById("scene-player"), times, (k) => {
      picture.src = scene.pictures[k];
      return dates ? dates[k] : `t = ${numberText(times[k])} s`;
    });
  }
  const maps = typeof drawMaps === "function" ? Promise.all(drawn).then(() => drawMaps({ figures, chart, addPlayer, numberText })).catch((error) => {
    for (const note of document.querySelectorAll(".map .source")) note.textContent = `The map is not drawn by this browser (${error}); expected a browser of 2023 or later.`;
  }) : [];

  // Printed pages have light colours and their own sizes [px], without the animated line; other content follows the figures.
  // A section fills the rest of its page, or starts on the next page if the rest is too small.
  // The curves of a section have a height of 70 mm or more.
  const PAGE = 985, LEAST = 266, GOOD = 420, WELL = 0.6, MOST = 760, HISTORY = 200, TOOLS = 22;
  const edges = (id) => figures[id].layout.margin.t - TOOLS + figures[id].layout.margin.b;
  const main = document.querySelector("main"), box = (node) => node.getBoundingClientRect();
  const paper = [...document.styleSheets].flatMap((one) => [...one.cssRules]).find((rule) => rule.conditionText === "print");
  const later = document.getElementById("later");
  const heights = Object.fromEntries(ids.map((id) => [id, figures[id].layout.height]));
  const tops = Object.fromEntries(ids.map((id) => [id, figures[id].layout.margin.t]));
  const moving = (id, seen) => {
    if (figures[id].moving) Plotly.restyle(chart(id), { visible: seen }, [figures[id].moving.trace]);
    legend(id);
  };
  const filled = () => {
    let page = box(main).top, spare = 0;
    for (const id of ids.map(chart).sort((a, b) => box(a).top - box(b).top)) {
      const figure = id.closest("figure"), before = figure.previousElementSibling;
      const first = before?.matches("figure") ? figure : figure.closest("section").querySelector("h2");
      id.style.height = "0";
      if (box(first).top - page > PAGE) {  // earlier tables crossed the end of a page, where rows are not cut
        page += PAGE * Math.floor((box(first).top - page) / PAGE);
        spare = 60;
      }
      const rest = box(figure).bottom - box(first).top, is_section = !id.id.startsWith("history-");
      const used = box(first).top - page, least = !is_section ? HISTORY : Math.max(LEAST + edges(id.id), used > WELL * PAGE ? GOOD : 0);
      let room = PAGE - rest - spare - used;
      if (room < least) {
        first.style.breakBefore = "page";
        [page, spare, room] = [box(first).top - 30, 0, PAGE - rest - 30];
      }
      id.style.height = `${is_section ? Math.min(room, MOST) : HISTORY}px`;
    }
  };
  addEventListener("beforeprint", () => {
    if (screen.matches) repaint(false);
    for (const id of ids) moving(id, false);
    paper.media.mediaText = "all";
    main.style.width = `${WIDE}px`;
    document.getElementById("model").before(later);
    filled();
    for (const id of ids) {
      const height = parseFloat(chart(id).style.height);
      Plotly.relayout(chart(id), { width: WIDE, height, autosize: false, "margin.t": tops[id] - TOOLS });
    }
    paper.media.mediaText = "print";
  });
  addEventListener("afterprint", () => {
    main.style.width = "";
    document.getElementById("verdict").append(later);
    for (const node of document.querySelectorAll("h2, figure, .chart")) node.style.breakBefore = node.style.height = "";
    for (const id of ids) {
      moving(id, true);
      Plotly.relayout(chart(id), { width: null, height: heights[id], autosize: true, "margin.t": tops[id] });
    }
    if (screen.matches) repaint(true);
  });
  Promise.all([...drawn, maps]).then(() => { document.documentElement.dataset.drawn = drawn.length; });
})();
