// Turns the picture of a cell: drag, or arrow keys; + and - zoom; double-click or Home gives the first picture back.
(() => {
  "use strict";
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const hull = (list) => {
    const p = list.slice().sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const half = (points) => {
      const out = [];
      for (const q of points) {
        while (out.length > 1) {
          const [a, b] = out.slice(-2);
          if ((b[0] - a[0]) * (q[1] - a[1]) - (b[1] - a[1]) * (q[0] - a[0]) > 0) break;
          out.pop();
        }
        out.push(q);
      }
      out.pop();
      return out;
    };
    return p.length < 3 ? p : [...half(p), ...half(p.reverse())];
  };
  const make = (holder) => {
    const still = holder.querySelector("svg");
    const scene = JSON.parse(holder.querySelector("script").textContent);
    const canvas = document.createElement("canvas");
    canvas.hidden = true;
    holder.prepend(canvas);
    holder.tabIndex = 0;
    holder.setAttribute("role", "img");
    holder.setAttribute("aria-label", "The cell; arrow keys turn it, + and - zoom, Home gives the first picture back.");
    const first = { turn: Math.atan2(scene.look[1], scene.look[0]), dip: Math.asin(-scene.look[2]), zoom: 1 };
    let eye = { ...first };
    // what is to stay on the page however it is turned: everything but the room
    const all = [...scene.arms.flatMap((a) => a.p), ...scene.balls.map((b) => b.p), ...scene.marks.map((m) => m.p),
      ...scene.bodies.filter((b) => !b.pale).flatMap((b) => b.p)];
    const low = [0, 1, 2].map((k) => all.reduce((m, p) => Math.min(m, p[k]), Infinity));
    const high = [0, 1, 2].map((k) => all.reduce((m, p) => Math.max(m, p[k]), -Infinity));
    const middle = low.map((l, k) => (l + high[k]) / 2);
    const reach = all.reduce((m, p) => Math.max(m, Math.hypot(...p.map((x, k) => x - middle[k]))), 0.1);
    const draw = () => {
      const box = still.viewBox.baseVal;
      const wide = holder.clientWidth && Math.min(holder.clientWidth, box.width);
      const tall = wide * box.height / box.width;
      const dense = window.devicePixelRatio || 1;
      canvas.width = wide * dense;
      canvas.height = tall * dense;
      canvas.style.width = wide + "px";
      canvas.style.height = tall + "px";
      const g = canvas.getContext("2d");
      g.scale(dense, dense);
      g.fillStyle = "#fafbfc";
      g.fillRect(0, 0, wide, tall);
      g.lineJoin = g.lineCap = "round";
      const [s, c, sd, cd] = [Math.sin(eye.turn), Math.cos(eye.turn), Math.sin(eye.dip), Math.cos(eye.dip)];
      const look = [c * cd, s * cd, -sd], right = [s, -c, 0], down = [-c * sd, -s * sd, -cd];
      const scale = eye.zoom * Math.min(wide, tall) / (2.1 * reach);
      const at = (p) => {
        const d = p.map((x, k) => x - middle[k]);
        return [wide / 2 + scale * dot(d, right), tall / 2 + scale * dot(d, down), dot(d, look)];
      };
      const path = (points, closed) => {
        g.beginPath();
        points.forEach((p, k) => (k ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1])));
        if (closed) g.closePath();
      };
      const disc = (p, r, fill) => {
        g.beginPath();
        g.arc(p[0], p[1], r, 0, 2 * Math.PI);
        g.fillStyle = fill;
        g.fill();
      };
      const things = [];
      for (const b of scene.bodies) {
        const p = b.p.map(at);
        // long bodies in pieces, so that what is nearer lies over them
        const pieces = b.p.length === 2 ? 6 : 1;
        for (let k = 0; k < pieces; k++) {
          const cut = (t) => p[0].map((x, i) => x + (p[1][i] - x) * t);
          const part = pieces > 1 ? [cut(k / pieces), cut((k + 1) / pieces)] : hull(p);
          const depth = pieces > 1 ? (part[0][2] + part[1][2]) / 2 : p.reduce((m, q) => m + q[2], 0) / p.length;
          things.push({ depth: b.pale ? 1e3 + depth : depth, draw: () => {
            path(part, pieces === 1);
            g.globalAlpha = b.pale ? 0.6 : 1;
            g.lineWidth = 2 * b.r * scale + 1.5;
            g.strokeStyle = pieces > 1 && b.r > 0 ? b.fill : b.edge;
            g.stroke();
            if (pieces === 1) {
              g.fillStyle = b.fill;
              g.fill();
              if (b.r * scale > 0.5) {
                g.lineWidth = 2 * b.r * scale;
                g.strokeStyle = b.fill;
                g.stroke();
              }
            }
            g.globalAlpha = 1;
          } });
        }
        if (pieces > 1) things.push({ depth: Math.max(p[0][2], p[1][2]) + 1e-3, draw: () => {
          path(p, false);
          g.lineWidth = 2 * b.r * scale + 2;
          g.strokeStyle = b.edge;
          g.stroke();
        } });
      }
      for (const b of scene.balls) {
        const p = at(b.p);
        things.push({ depth: p[2] - 0.02, draw: () => disc(p, Math.max(4, b.r * scale), b.fill) });
      }
      things.sort((a, b) => b.depth - a.depth).forEach((t) => t.draw());
      if (scene.sphere) {
        const p = at(scene.sphere.p);
        g.beginPath();
        g.arc(p[0], p[1], scene.sphere.r * scale, 0, 2 * Math.PI);
        g.setLineDash([5, 4]);
        g.lineWidth = 1;
        g.strokeStyle = "#2666a5";
        g.stroke();
        g.setLineDash([]);
      }
      for (const a of scene.arms) {
        const p = a.p.map(at);
        g.strokeStyle = a.ink;
        g.globalAlpha = 0.5;
        g.lineWidth = 1.3;
        path(p, false);
        g.stroke();
        g.globalAlpha = 0.9;
        g.lineWidth = 2.2;
        path([at(a.from), p[p.length - 1]], false);
        g.stroke();
        g.globalAlpha = 1;
      }
      for (const m of scene.marks) {
        const p = at(m.p);
        disc(p, 4.4, "#fff");
        disc(p, 3.6, m.fill);
      }
      g.font = "700 15px system-ui, sans-serif";
      scene.balls.forEach((b, k) => {
        const p = at(b.p);
        g.fillStyle = b.fill;
        g.strokeStyle = "#fff";
        g.lineWidth = 3;
        g.strokeText(String(k + 1), p[0] + 9, p[1] - 8);
        g.fillText(String(k + 1), p[0] + 9, p[1] - 8);
      });
      g.font = "italic 13px system-ui, sans-serif";
      g.strokeStyle = g.fillStyle = "#1d2733";
      g.lineWidth = 1.6;
      // as long as in the picture for paper
      const long = Math.max(0.1, 30 / scale);
      [["x", [long, 0, 0]], ["y", [0, long, 0]], ["z", [0, 0, long]]].forEach(([name, tip]) => {
        path([at([0, 0, 0]), at(tip)], false);
        g.stroke();
        const p = at(tip.map((x) => 1.18 * x));
        g.fillText(name, p[0] - 4, p[1] + 4);
      });
    };
    const show = (turned) => {
      canvas.hidden = !turned;
      holder.classList.toggle("turned", turned);
      if (turned) draw();
    };
    const by = (turn, dip) => {
      eye.turn += turn;
      eye.dip = Math.max(-1.57, Math.min(1.57, eye.dip + dip));
      show(true);
    };
    const home = () => {
      eye = { ...first };
      show(false);
    };
    let from = null;
    holder.addEventListener("pointerdown", (e) => {
      from = [e.clientX, e.clientY];
      holder.setPointerCapture(e.pointerId);
    });
    holder.addEventListener("pointermove", (e) => {
      if (!from || Math.hypot(e.clientX - from[0], e.clientY - from[1]) < 2) return;
      by((from[0] - e.clientX) * 0.008, (e.clientY - from[1]) * 0.008);
      from = [e.clientX, e.clientY];
    });
    ["pointerup", "pointercancel"].forEach((name) => holder.addEventListener(name, () => { from = null; }));
    holder.addEventListener("dblclick", home);
    const keys = {
      ArrowLeft: () => by(0.1, 0), ArrowRight: () => by(-0.1, 0), ArrowUp: () => by(0, -0.1), ArrowDown: () => by(0, 0.1),
      "+": () => { eye.zoom *= 1.15; show(true); }, "-": () => { eye.zoom /= 1.15; show(true); }, Home: home,
    };
    holder.addEventListener("keydown", (e) => {
      if (!keys[e.key] || e.ctrlKey || e.altKey || e.metaKey) return;
      e.preventDefault();
      keys[e.key]();
    });
    addEventListener("resize", () => { if (!canvas.hidden) draw(); });
  };
  document.querySelectorAll(".turn").forEach(make);
})();
