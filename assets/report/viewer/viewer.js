// The viewer: the avatar's pose from the motion and the sliders, the picture, and everything around it.

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

class Viewer {
  constructor(root, scene) {
    this.find = (name) => root.querySelector(`[data-viewer="${name}"]`);
    this.canvas = this.find("canvas");
    this.avatar = new Avatar(scene);
    this.drawing = new Drawing(this.canvas);
    this.skinned = this.drawing.upload(this.avatar);
    this.colours = this.avatar.colours;
    this.shownMesh = null;
    this.angles = new Map();
    this.expression = new Array(this.avatar.expressions.count).fill(0);
    this.seconds = 0;
    this.playing = false;
    this.mode = "colour";
    this.isNeeded = true;
    this.onPose = () => {};

    const first = this.avatar.motionAt(0);
    const [lowest, highest] = this.avatar.bounds(this.avatar.jointRows(first));
    this.floor = lowest[1];
    this.start = first.place;
    const target = [0, 1, 2].map((axis) => (lowest[axis] + highest[axis]) / 2);
    // Room for arms that the first pose does not raise.
    const height = 1.18 * (highest[1] - lowest[1]);
    const distance = height / 2 / Math.tan(VERTICAL_ANGLE / 2);
    this.orbit = new Orbit(this.canvas, { azimuth: 0.45, elevation: 0.09, distance, target }, () => this.draw());

    this.makeTime();
    this.makeModes();
    this.makeSliders();
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.canvas.addEventListener("webglcontextlost", () => this.say("The graphics card was reset; reload the page."));
    new IntersectionObserver(([entry]) => {
      this.isVisible = entry.isIntersecting;
      this.draw();
    }).observe(this.canvas);
    requestAnimationFrame((now) => this.frame(now));
  }

  say(text) {
    this.find("note").textContent = text;
  }

  // The local rotations (J), the root's place and the expression that the motion and the sliders make.
  pose() {
    const { rotations, place, expression } = this.avatar.motionAt(this.seconds);
    for (const [handle, degrees] of this.angles) {
      for (const { joint, axis, share } of handle.turns) {
        const turn = quaternionOfAxisAngle(axis, (degrees * share * Math.PI) / 180);
        rotations[joint] = multiplyQuaternions(rotations[joint], turn);
      }
    }
    return { rotations, place, expression: expression.map((value, index) => value + this.expression[index]) };
  }

  makeTime() {
    const { motion } = this.avatar;
    const [slider, output, button] = [this.find("time"), this.find("clock"), this.find("play")];
    if (motion.frames < 2) {
      this.find("timeline").hidden = true;
      return;
    }
    this.duration = (motion.frames - 1) / motion.rate;
    slider.max = this.duration;
    slider.step = 1 / motion.rate;
    this.showTime = () => {
      slider.value = this.seconds;
      output.textContent = `${this.seconds.toFixed(1)} s`;
      slider.setAttribute("aria-valuetext", `${this.seconds.toFixed(1)} of ${this.duration.toFixed(1)} seconds`);
    };
    slider.addEventListener("input", () => {
      this.play(false);
      this.seconds = Number(slider.value);
      this.showTime();
      this.changePose();
    });
    button.addEventListener("click", () => this.play(!this.playing));
    this.canvas.addEventListener("keydown", (event) => {
      if (event.key !== " ") return;
      event.preventDefault();
      this.play(!this.playing);
    });
    this.showTime();
    this.play(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  }

  play(playing) {
    this.playing = playing;
    this.find("play").textContent = playing ? "Pause" : "Play";
    this.changePose();
  }

  makeModes() {
    const legend = this.find("legend");
    for (const { name, colour } of this.avatar.parts) {
      const swatch = element("span", { class: "swatch" });
      swatch.style.background = `rgb(${colour.join()})`;
      legend.append(element("li", {}, swatch, name));
    }
    for (const choice of this.find("modes").querySelectorAll("input")) {
      choice.addEventListener("change", () => this.show(choice.value));
    }
  }

  show(mode) {
    this.mode = mode;
    this.find("legend").hidden = mode !== "parts";
    const { avatar } = this;
    this.colours = {
      parts: () => avatar.coloursByJoint((joint) => avatar.parts[avatar.jointParts[joint]].colour, false),
      weights: () => avatar.coloursByJoint((joint) => avatar.jointColours[joint], true),
    }[mode]?.() ?? avatar.colours;
    this.drawing.replace(this.skinned, "colours", this.colours);
    this.draw();
  }

  makeSliders() {
    const panel = this.find("sliders");
    const groups = handlesOf(this.avatar.jointNames).map(({ group, handles }, index) => {
      const rows = handles.map((handle) => this.slider(`${group}: ${handle.label}`, handle.label, {
        low: handle.low, high: handle.high, step: 1, text: (value) => `${value}°`,
        set: (value) => this.angles.set(handle, value),
      }));
      return element("details", index === 0 ? { open: "" } : {}, element("summary", {}, group), ...rows);
    });
    if (this.expression.length > 0) {
      const rows = this.expression.map((_, index) => this.slider(`Expression ${index + 1}`, `Expression ${index + 1}`, {
        low: -3, high: 3, step: 0.1, text: (value) => value.toFixed(1),
        set: (value) => { this.expression[index] = value; },
      }));
      groups.splice(1, 0, element("details", {}, element("summary", {}, "Expression"), ...rows));
    }
    panel.append(...groups);
    this.find("reset").addEventListener("click", () => {
      for (const input of panel.querySelectorAll("input")) {
        input.value = 0;
        input.dispatchEvent(new Event("input"));
      }
      this.orbit.reset();
    });
  }

  slider(name, label, { low, high, step, text, set }) {
    const input = element("input", { type: "range", min: low, max: high, step, value: 0, "aria-label": name, name });
    const output = element("output", { "aria-hidden": "true" });
    const show = () => {
      const value = Number(input.value);
      output.textContent = text(value);
      input.setAttribute("aria-valuetext", text(value));
      set(value);
    };
    input.addEventListener("input", () => {
      show();
      this.changePose();
    });
    show();
    return element("label", { class: "slider" }, element("span", {}, label), input, output);
  }

  changePose() {
    this.poseChanged = true;
    this.draw();
  }

  // Asks for a new picture with the browser's next frame.
  draw() {
    this.isNeeded = true;
  }

  frame(now) {
    const elapsed = Math.min((now - (this.before ?? now)) / 1000, 0.1);
    this.before = now;
    if (this.playing && this.isVisible) {
      this.seconds = (this.seconds + elapsed) % this.duration;
      this.showTime();
      this.changePose();
    }
    if (this.drawing.resize() || this.isNeeded) this.paint();
    requestAnimationFrame((next) => this.frame(next));
  }

  paint() {
    this.isNeeded = false;
    const pose = this.pose();
    if (this.poseChanged) {
      this.poseChanged = false;
      this.onPose(pose);
    }
    if (this.avatar.express(pose.expression)) this.drawing.replace(this.skinned, "positions", this.avatar.positions);
    const [x, , z] = pose.place.map((value, axis) => value - this.start[axis]);
    const { target, ...camera } = this.orbit.camera;
    const follow = [target[0] + x, target[1], target[2] + z];
    const isDark = matchMedia("(prefers-color-scheme: dark)").matches;
    this.drawing.draw(this.shownMesh ?? this.skinned, {
      camera: { ...camera, target: follow },
      rows: this.avatar.jointRows(pose),
      mode: this.shownMesh && this.mode !== "normals" ? "colour" : this.mode,
      shadow: { centre: [follow[0], this.floor, follow[2]], darkness: isDark ? 0.6 : 0.32 },
    });
  }
}
