// Panes that show layers of one photo, larger and moved all alike.
const panes = (() => {
  const MOST = 16;
  // x, y: the pane's upper left corner, in shares of the picture.
  const at = { scale: 1, x: 0, y: 0 };
  const fingers = new Map();
  let stages = [];

  function place() {
    const free = 1 - 1 / at.scale;
    at.x = Math.min(Math.max(at.x, 0), free);
    at.y = Math.min(Math.max(at.y, 0), free);
    for (const { stage, moved } of stages) {
      const [x, y] = [at.x, at.y].map((share) => -100 * share * at.scale);
      moved.style.transform = `translate(${x}%, ${y}%) scale(${at.scale})`;
      stage.classList.toggle("large", at.scale > 1);
    }
  }

  // So that what lies at (x, y), in shares of the pane, stays there.
  function zoom(times, x = 0.5, y = 0.5) {
    const before = at.scale;
    at.scale = times ? Math.min(Math.max(before * times, 1), MOST) : 1;
    at.x += x / before - x / at.scale;
    at.y += y / before - y / at.scale;
    place();
  }

  function shift(x, y) {
    at.x += x / at.scale;
    at.y += y / at.scale;
    place();
  }

  function inside(stage, event) {
    const box = stage.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  }

  function listen(stage) {
    stage.addEventListener("pointerdown", (event) => {
      stage.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, inside(stage, event));
    });
    stage.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const now = inside(stage, event);
      fingers.set(event.pointerId, now);
      if (fingers.size === 1) return shift(before[0] - now[0], before[1] - now[1]);
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const away = (one) => Math.hypot(one[0] - other[0], one[1] - other[1]);
      zoom(away(now) / Math.max(away(before), 1e-3), ...now);
    });
    for (const kind of ["pointerup", "pointercancel"]) {
      stage.addEventListener(kind, (event) => fingers.delete(event.pointerId));
    }
    stage.addEventListener("wheel", (event) => {
      // A page that scrolls must not stop here: a click first, or Ctrl.
      if (!event.ctrlKey && document.activeElement !== stage) return;
      event.preventDefault();
      zoom(2 ** (-event.deltaY / 300), ...inside(stage, event));
    }, { passive: false });
    stage.addEventListener("dblclick", (event) => zoom(2, ...inside(stage, event)));
    stage.addEventListener("keydown", (event) => {
      const steps = {
        ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1],
      };
      if (steps[event.key] && at.scale > 1) shift(...steps[event.key]);
      else if (event.key === "+" || event.key === "=") zoom(1.5);
      else if (event.key === "-") zoom(1 / 1.5);
      else if (event.key === "0") zoom(0);
      else return;
      event.preventDefault();
    });
  }

  // As many panes as there are pictures: {src, name, alt, offset, sharp, over}.
  function show(parent, pictures) {
    if (stages.length !== pictures.length) {
      parent.replaceChildren();
      stages = pictures.map(() => {
        const figure = document.createElement("figure");
        figure.innerHTML = '<div class="stage" tabindex="0" role="group"><div class="moved">'
          + '<img alt="" draggable="false"><svg aria-hidden="true"></svg></div></div>'
          + "<figcaption></figcaption>";
        parent.append(figure);
        const stage = figure.firstChild;
        listen(stage);
        return {
          figure, stage, moved: stage.firstChild, image: stage.querySelector("img"),
          over: stage.querySelector("svg"), text: figure.lastChild,
        };
      });
      parent.style.setProperty("--count", stages.length);
    }
    pictures.forEach((picture, i) => {
      const { stage, image, text, over } = stages[i];
      image.onload = () => {
        const shape = image.naturalWidth / image.naturalHeight;
        parent.style.setProperty("--shape", shape);
        const [x, y] = picture.offset ?? [0, 0];
        const [w, h] = [image.naturalWidth, image.naturalHeight];
        image.style.transform = `translate(${100 * x / w}%, ${100 * y / h}%)`;
      };
      image.src = picture.src;
      image.alt = picture.alt;
      image.classList.toggle("sharp", picture.sharp);
      stage.setAttribute("aria-label", `${picture.alt}: plus and minus zoom, arrow keys move`);
      text.textContent = picture.name;
      picture.over(over);
    });
    place();
  }

  return { show, zoom, at };
})();
