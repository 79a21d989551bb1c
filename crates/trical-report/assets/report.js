// Draws the plots of a report with uPlot over their static pictures; print and a browser without scripts keep those.
(() => {
  "use strict";
  // five digits, as the data has them
  const round = (v) => (v == null ? "" : String(Number(v.toPrecision(5))));
  // a point for decimals and nothing between thousands, as in the tables, whatever the language of the browser
  const ticks = (_, all) => all.map((v) => (v == null ? "" : String(Number(v.toPrecision(9)))));
  // between whole numbers, such as those of sessions, there is nothing
  const steps = Array.from({ length: 24 }, (_, k) => [1, 2, 5][k % 3] * 10 ** Math.floor(k / 3));
  // the next number that an axis from zero has a tick at: nothing is drawn above the highest one
  const upToTick = (high) => {
    const size = 10 ** Math.floor(Math.log10(high / 5));
    const step = [1, 2, 5, 10].map((k) => k * size).find((s) => high / s <= 5) || 10 * size;
    return Math.ceil(high / step) * step;
  };
  // the widest number has room beside the label
  const room = (_, all) => Math.max(64, 24 + 8 * Math.max(0, ...(all || []).map((v) => v.length)));
  const make = (holder) => {
    const plot = JSON.parse(holder.querySelector("script").textContent);
    const stage = document.createElement("div");
    stage.className = "live";
    holder.prepend(stage);
    const x = plot.data[0];
    // the point nearest to the pointer, along both axes; without one, the nearest along x
    const nearest = (u, series, along) => {
      const { left, top } = u.cursor;
      if (plot.joined || left < 0) return along;
      let best = along, least = Infinity;
      for (let s = 1; s < u.data.length; s++) {
        if (!u.series[s].show) continue;
        for (let k = 0; k < x.length; k++) {
          if (u.data[s][k] == null) continue;
          const d = Math.hypot(u.valToPos(x[k], "x") - left, u.valToPos(u.data[s][k], "y") - top);
          if (d < least) { least = d; best = k; }
        }
      }
      return best;
    };
    const ink = (_, k) => (k > 0 ? plot.series[k - 1].color : null);
    const width = () => Math.max(240, Math.min(holder.clientWidth, 940));
    const u = new uPlot({
      width: width(),
      height: 340,
      scales: {
        x: { time: false },
        y: { range: (_, low, high) => {
          const pad = Math.max((high - low) * 0.06, 1e-9);
          return plot.zero && high > 0 ? [0, upToTick(high + pad)] : [low - pad, high + pad];
        } },
      },
      axes: [
        { label: plot.x, stroke: "#47566a", grid: { stroke: "#eceff3" }, values: ticks, incrs: plot.whole ? steps : undefined },
        { label: plot.y, stroke: "#47566a", grid: { stroke: "#eceff3" }, size: room, values: ticks },
      ],
      // points have no line, whose colour the legend would take
      legend: { markers: { width: 2, stroke: ink, fill: ink } },
      cursor: { dataIdx: nearest, drag: { x: true, y: true, uni: 30 } },
      series: [
        { label: plot.x.replace(/, in the order.*/, ""), value: (_, v, __, k) => (v == null ? "" : round(v) + (plot.rows[k] ? " (" + plot.rows[k] + ")" : "")) },
        ...plot.series.map((s) => ({
          label: s.name,
          stroke: s.color,
          width: plot.joined ? 2 : 0,
          paths: plot.joined ? undefined : () => null,
          points: { show: plot.points, size: 5, fill: s.color, stroke: s.color, width: 0 },
          value: (_, v) => round(v),
        })),
      ],
    }, plot.data, stage);
    holder.classList.add("drawn");
    const fit = () => u.setSize({ width: width(), height: 340 });
    addEventListener("resize", fit);
    // a plot that is folded away has no width until it is opened
    const fold = holder.closest("details");
    if (fold) fold.addEventListener("toggle", fit);
  };
  document.querySelectorAll(".plot").forEach(make);
  addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => { d.open = true; }));
})();
