"use strict";
// Draws the time series, and keeps plots, path and video at the same moment.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const video = document.querySelector("video");
  const path = document.getElementById("path");
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const charts = [];
  let now_s = null;

  const font = "12px system-ui, sans-serif";
  const pen = document.createElement("canvas").getContext("2d");
  // Room for the numbers of an axis between its line and its label.
  function width_of(numbers) {
    const ticks = 20;
    pen.font = font;
    return Math.max(56, ticks + Math.ceil(Math.max(0, ...(numbers || []).map((text) => pen.measureText(text || "").width))));
  }

  const digits = (value) => (value == null ? "--" : Number(value.toPrecision(4)).toString());

  function series(spec) {
    const line = spec.kind !== "dots";
    const edge = spec.kind === "band";
    const stroke = edge ? "transparent" : colour(spec.colour);
    return {
      label: spec.label, stroke, width: line ? 1.5 : 0, spanGaps: false,
      value: (u, value) => digits(value),
      paths: line ? undefined : () => null,
      points: { show: !line, size: spec.colour === "observed" ? 5 : 3.5, fill: stroke, stroke, width: 0 },
    };
  }

  function bands(specs) {
    const list = [];
    specs.forEach((spec, i) => {
      // Bands come as pairs: upper edge, then lower edge.
      if (spec.kind === "band" && specs[i + 1] && specs[i + 1].kind === "band" && spec.upper)
        list.push({ series: [i + 1, i + 2], fill: colour(spec.colour) });
    });
    return list;
  }

  function build(holder) {
    const object = data.objects[Number(holder.dataset.object)];
    const chart = object.charts[Number(holder.dataset.chart)];
    const axis = { stroke: colour("words"), grid: { stroke: colour("rule"), width: 0.5 }, ticks: { stroke: colour("rule"), width: 0.5 }, font, labelFont: font };
    const options = {
      width: Math.max(260, holder.clientWidth), height: 240,
      scales: { x: { time: false }, y: chart.limit ? { range: [-chart.limit, chart.limit] } : {} },
      axes: [{ ...axis, label: "t [s]", labelSize: 18, size: 34 }, { ...axis, label: chart.label, labelSize: 20, size: (u, numbers) => width_of(numbers) }],
      series: [{ label: "t", value: (u, v) => (v == null ? "--" : v.toFixed(4) + " s") }, ...chart.series.map(series)],
      bands: bands(chart.series),
      cursor: { y: false, sync: { key: "time" }, drag: { x: true, y: false }, points: { size: 7 } },
      legend: { live: true, markers: { width: 0, fill: (u, i) => (i > 0 ? colour(chart.series[i - 1].colour) : null) } },
    };
    const plot = new uPlot(options, [object.t, ...chart.series.map((s) => s.values)], holder);
    // Band edges need no line in the legend.
    plot.root.querySelectorAll(".u-series").forEach((row, i) => {
      if (i > 0 && chart.series[i - 1].kind === "band") row.style.display = "none";
    });
    let down = 0;
    plot.over.addEventListener("mousedown", (event) => { down = event.clientX; });
    plot.over.addEventListener("click", (event) => {
      if (Math.abs(event.clientX - down) < 4) go(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
    });
    new ResizeObserver(() => {
      const width = Math.max(260, holder.clientWidth);
      if (width !== plot.width) { plot.setSize({ width, height: 240 }); follow(now_s); }
    }).observe(holder);
    return plot;
  }

  function rebuild() {
    while (charts.length) charts.pop().destroy();
    document.querySelectorAll(".chart").forEach((holder) => charts.push(build(holder)));
    follow(now_s);
  }

  function nearest(times, t) {
    let low = 0, high = times.length - 1;
    while (high - low > 1) { const middle = (low + high) >> 1; if (times[middle] <= t) low = middle; else high = middle; }
    return Math.abs(times[low] - t) <= Math.abs(times[high] - t) ? low : high;
  }

  function place(name, x, y) {
    const dot = document.getElementById("path-cursor-" + name);
    if (!dot) return;
    const shown = x != null && y != null;
    dot.setAttribute("visibility", shown ? "visible" : "hidden");
    if (!shown) return;
    dot.setAttribute("cx", Number(path.dataset.x0) + Number(path.dataset.kx) * x);
    dot.setAttribute("cy", Number(path.dataset.y0) + Number(path.dataset.ky) * y);
  }

  // Moves every cursor to a moment of the recording.
  function follow(t) {
    if (t == null) return;
    now_s = t;
    charts.forEach((plot) => {
      const left = plot.valToPos(t, "x");
      plot.setCursor({ left: left >= 0 && left <= plot.over.clientWidth ? left : -10, top: 10 }, false);
    });
    data.objects.forEach((object, i) => {
      if (!object.t.length) return;
      const k = nearest(object.t, t);
      place("observed" + i, object.path.observed_x[k], object.path.observed_y[k]);
      place("predicted" + i, object.path.predicted_x && object.path.predicted_x[k], object.path.predicted_y && object.path.predicted_y[k]);
    });
  }

  // Seeks the video to a moment of the recording; the cursors follow.
  function go(t) {
    if (video && data.video.t.length) {
      const k = nearest(data.video.t, t);
      video.pause();
      video.currentTime = (k + 0.5) / data.video.rate;
    }
    follow(t);
  }

  const shown = () => {
    const k = Math.floor(video.currentTime * data.video.rate + 1e-3);
    return data.video.t[Math.min(Math.max(k, 0), data.video.t.length - 1)];
  };
  if (video && data.video.t.length) {
    const tick = () => { follow(shown()); if (!video.paused && !video.ended) requestAnimationFrame(tick); };
    video.addEventListener("play", tick);
    video.addEventListener("seeked", () => follow(shown()));
    video.addEventListener("timeupdate", () => { if (video.paused) follow(shown()); });
  }
  if (path) path.addEventListener("click", (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(path.getScreenCTM().inverse());
    const x = (at.x - path.dataset.x0) / path.dataset.kx, y = (at.y - path.dataset.y0) / path.dataset.ky;
    let best = null, least = Infinity;
    data.objects.forEach((object) => object.t.forEach((t, k) => {
      const d = Math.hypot(object.path.observed_x[k] - x, object.path.observed_y[k] - y);
      if (object.path.observed_x[k] != null && d < least) { least = d; best = t; }
    }));
    if (best != null) go(best);
  });

  rebuild();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", rebuild);
  addEventListener("beforeprint", rebuild);
  addEventListener("afterprint", rebuild);
  window.trochoid = { go, follow, charts, now: () => now_s };
})();
