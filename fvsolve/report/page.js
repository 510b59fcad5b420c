"use strict";
(() => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
  const histories = Object.keys(figures).filter((id) => id.startsWith("history-"));
  const chart = (id) => document.getElementById(id);

  // Where fingers scroll, a chart is zoomed by its buttons; on a narrow page names that would cover each other give way.
  const touched = matchMedia("(pointer: coarse)").matches;
  if (touched) config.displayModeBar = true;
  for (const [id, one] of Object.entries(figures)) {
    if (touched) one.layout.dragmode = false;
    if (!one.layout.annotations) continue;
    const apart = 24 / (chart(id).clientWidth - 76) * (one.layout.xaxis.range[1] - one.layout.xaxis.range[0]);
    const kept = [];
    for (const name of one.layout.annotations)
      if (kept.every((other) => Math.abs(other.x - name.x) >= apart)) kept.push(name);
    one.layout.annotations = kept;
  }

  const drawn = Object.entries(figures).map(([id, one]) => Plotly.newPlot(chart(id), one.data, one.layout, config));

  // One time axis for all histories: what is zoomed in one is zoomed in all.
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

  for (const player of document.querySelectorAll(".player")) {
    const id = player.dataset.for;
    const { trace, times, heads } = figures[id].moving;
    const [button, slider, output] = player.children;
    const pause = Math.max(40, Math.min(400, 8000 / times.length));
    let timer = null;
    const show = (k) => {
      slider.value = k;
      output.textContent = `t = ${Number(times[k].toPrecision(4))} s`;
      Plotly.restyle(chart(id), { y: [heads[k]] }, [trace]);
    };
    const stop = () => {
      clearInterval(timer);
      timer = null;
      button.textContent = "Play";
    };
    button.addEventListener("click", () => {
      if (timer !== null) return stop();
      if (Number(slider.value) >= times.length - 1) show(0);
      button.textContent = "Pause";
      timer = setInterval(() => {
        show(Number(slider.value) + 1);
        if (Number(slider.value) >= times.length - 1) stop();
      }, pause);
    });
    slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
    show(0);
  }

  // Paper has its own sizes; the moving line stays on the screen.
  const PAPER = 680, TALL = { section: 0.85, history: 0.77 };
  const heights = Object.fromEntries(Object.entries(figures).map(([id, one]) => [id, one.layout.height]));
  const moving = (id, seen) => {
    if (figures[id].moving) Plotly.restyle(chart(id), { visible: seen }, [figures[id].moving.trace]);
  };
  addEventListener("beforeprint", () => {
    for (const id of Object.keys(figures)) {
      moving(id, false);
      Plotly.relayout(chart(id), { width: PAPER, height: TALL[id.split("-")[0]] * heights[id], autosize: false });
    }
  });
  addEventListener("afterprint", () => {
    for (const id of Object.keys(figures)) {
      moving(id, true);
      Plotly.relayout(chart(id), { width: null, height: heights[id], autosize: true });
    }
  });
  Promise.all(drawn).then(() => { document.documentElement.dataset.drawn = drawn.length; });
})();
