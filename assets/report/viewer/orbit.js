// The camera on its sphere around the avatar: dragged, pinched, scrolled, or moved by the keyboard.

const TURN = 0.008;
const KEY_TURN = 0.12;
const KEY_ZOOM = 1.12;
const STEEPEST = 1.45;

class Orbit {
  constructor(canvas, home, onChange) {
    this.home = home;
    this.camera = { ...home };
    this.onChange = onChange;
    this.pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => this.pointers.delete(event.pointerId));
    }
    canvas.addEventListener("wheel", (event) => {
      // A page that scrolls under the pointer must not zoom: only once the picture has the focus, or with Ctrl as in maps.
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.0015));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const moves = {
        ArrowLeft: () => this.turn(-KEY_TURN, 0), ArrowRight: () => this.turn(KEY_TURN, 0),
        ArrowUp: () => this.turn(0, KEY_TURN), ArrowDown: () => this.turn(0, -KEY_TURN),
        "+": () => this.zoom(1 / KEY_ZOOM), "=": () => this.zoom(1 / KEY_ZOOM), "-": () => this.zoom(KEY_ZOOM),
        Home: () => this.reset(), 0: () => this.reset(),
      };
      if (!moves[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      moves[event.key]();
    });
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const share = 1 / this.pointers.size;
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const apart = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]) || 1;
      this.zoom(apart(before) / apart(now));
    }
    this.pointers.set(event.pointerId, now);
    this.turn((before[0] - now[0]) * TURN * share, (now[1] - before[1]) * TURN * share);
  }

  turn(azimuth, elevation) {
    this.camera.azimuth += azimuth;
    this.camera.elevation = Math.min(Math.max(this.camera.elevation + elevation, -0.4), STEEPEST);
    this.onChange();
  }

  zoom(factor) {
    const { distance } = this.home;
    this.camera.distance = Math.min(Math.max(this.camera.distance * factor, 0.15 * distance), 2.5 * distance);
    this.onChange();
  }

  reset() {
    this.camera = { ...this.home };
    this.onChange();
  }
}
