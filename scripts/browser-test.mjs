// Drives Chromium over its debugging pipe: no package is needed. See browser-test.sh.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [binary, run, out, body] = process.argv.slice(2);
const DESKTOP = { width: 1280, height: 900, deviceScaleFactor: 1, mobile: false };
const PHONE = { width: 390, height: 844, deviceScaleFactor: 2, mobile: true };
const PATIENCE = 120_000;

class Browser {
  constructor() {
    this.profile = mkdtempSync(join(tmpdir(), "browser-test-"));
    this.process = spawn("chromium", [
      "--headless=new", "--no-sandbox", "--remote-debugging-pipe", `--user-data-dir=${this.profile}`, "--no-first-run",
      "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars", "about:blank",
    ], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
    this.waiting = new Map();
    this.listeners = [];
    this.count = 0;
    let rest = "";
    this.process.stdio[4].on("data", (data) => {
      const messages = (rest + data).split("\0");
      rest = messages.pop();
      messages.forEach((message) => this.receive(JSON.parse(message)));
    });
  }

  receive(message) {
    if (!message.id) {
      this.listeners.forEach((listener) => listener(message));
      return;
    }
    const { done, failed } = this.waiting.get(message.id);
    this.waiting.delete(message.id);
    if (message.error) failed(new Error(JSON.stringify(message.error)));
    else done(message.result);
  }

  send(method, params = {}, sessionId = undefined) {
    this.count += 1;
    const id = this.count;
    this.process.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId })}\0`);
    return new Promise((done, failed) => { this.waiting.set(id, { done, failed }); });
  }

  async close() {
    await this.send("Browser.close").catch(() => {});
    await new Promise((done) => { this.process.on("exit", done); setTimeout(done, 5000); });
    rmSync(this.profile, { recursive: true, force: true, maxRetries: 5, retryDelay: 200 });
  }
}

class Page {
  static async open(browser, url, { size = DESKTOP, scheme = "light", offline = false } = {}) {
    const { targetId } = await browser.send("Target.createTarget", { url: "about:blank" });
    const { sessionId } = await browser.send("Target.attachToTarget", { targetId, flatten: true });
    const page = new Page();
    Object.assign(page, { browser, sessionId, targetId, errors: [], requests: [] });
    browser.listeners.push(({ method, params, sessionId: of }) => {
      if (of !== sessionId) return;
      if (method === "Network.requestWillBeSent") page.requests.push(params.request.url);
      if (method === "Runtime.exceptionThrown") page.errors.push(JSON.stringify(params.exceptionDetails));
      // What WebGL refuses is only a warning to the browser.
      const isError = (entry) => entry.level === "error" || /INVALID_/.test(entry.text);
      if (method === "Log.entryAdded" && isError(params.entry)) page.errors.push(params.entry.text);
      if (method === "Runtime.consoleAPICalled" && params.type === "error") page.errors.push(JSON.stringify(params.args));
    });
    for (const domain of ["Page", "Runtime", "Log", "Network"]) await page.send(`${domain}.enable`);
    if (offline) {
      const conditions = { offline: true, latency: 0, downloadThroughput: 0, uploadThroughput: 0 };
      await page.send("Network.emulateNetworkConditions", conditions);
    }
    await page.send("Emulation.setDeviceMetricsOverride", size);
    await page.send("Emulation.setEmulatedMedia", { features: [
      { name: "prefers-color-scheme", value: scheme }, { name: "prefers-reduced-motion", value: "reduce" },
    ] });
    await page.send("Page.navigate", { url });
    await page.until("document.querySelector('#viewer.started')", "the viewer starts");
    return page;
  }

  send(method, params) {
    return this.browser.send(method, params, this.sessionId);
  }

  async evaluate(expression) {
    const reply = await this.send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    assert.ok(!reply.exceptionDetails, JSON.stringify(reply.exceptionDetails));
    return reply.result.value;
  }

  async until(expression, what) {
    const end = Date.now() + PATIENCE;
    while (Date.now() < end) {
      if (await this.evaluate(`Boolean(${expression})`)) return;
      await new Promise((done) => { setTimeout(done, 100); });
    }
    assert.fail(`${what}: ${expression}\n${this.errors.join("\n")}`);
  }

  // The viewer's picture once it is drawn, as a data URI.
  picture() {
    return this.evaluate(`new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() =>
      done(document.querySelector('[data-viewer=canvas]').toDataURL()))))`);
  }

  async set(name, value) {
    await this.evaluate(`(() => {
      const input = document.querySelector(${JSON.stringify(`input[name="${name}"]`)});
      input.value = ${value};
      input.dispatchEvent(new Event("input", { bubbles: true }));
    })()`);
  }

  async screenshot(file, wholePage) {
    const { data } = await this.send("Page.captureScreenshot", { format: "png", captureBeyondViewport: wholePage });
    writeFileSync(join(out, file), Buffer.from(data, "base64"));
  }

  // Of all of the page, by making the window as high as it.
  async fullScreenshot(file, size) {
    const height = Math.min(await this.evaluate("document.documentElement.scrollHeight"), 9000);
    await this.send("Emulation.setDeviceMetricsOverride", { ...size, height, deviceScaleFactor: 1 });
    await this.picture();
    await this.screenshot(file, false);
  }

  close() {
    return this.browser.send("Target.closeTarget", { targetId: this.targetId });
  }
}

async function testReport(browser) {
  const url = pathToFileURL(resolve(run, "report.html")).href;
  const page = await Page.open(browser, url, { offline: true });
  const first = await page.picture();
  for (const slider of ["Left arm: Elbow", "Head and jaw: Jaw", "Expression 1", "Hands: Right fist"]) {
    const before = await page.picture();
    await page.set(slider, await page.evaluate(`document.querySelector('input[name="${slider}"]').max`));
    assert.ok((await page.picture()) !== before, `${slider} changes the picture`);
  }
  await page.evaluate("document.querySelector('[data-viewer=reset]').click()");
  assert.ok((await page.picture()) === first, "reset brings the first picture back");
  const seen = new Set([first]);
  for (const mode of ["normals", "parts", "weights"]) {
    await page.evaluate(`document.querySelector('input[value=${mode}]').click()`);
    seen.add(await page.picture());
    await page.screenshot(`report-${mode}.png`, false);
  }
  assert.equal(seen.size, 4, "each mode has its picture");
  await page.evaluate("document.querySelector('input[value=colour]').click()");
  await page.evaluate(`(() => {
    const time = document.querySelector('[data-viewer=time]');
    time.value = Number(time.max) / 3;
    time.dispatchEvent(new Event("input"));
  })()`);
  assert.ok((await page.picture()) !== first, "time changes the picture");
  const turned = await page.picture();
  await page.evaluate("document.querySelector('[data-viewer=canvas]').focus()");
  await page.send("Input.dispatchKeyEvent", { type: "keyDown", key: "ArrowLeft", code: "ArrowLeft" });
  assert.ok((await page.picture()) !== turned, "arrow keys turn the view");
  const still = await page.picture();
  const time = "document.querySelector('[data-viewer=time]').value";
  const before = await page.evaluate(time);
  await page.evaluate("document.querySelector('[data-viewer=play]').click()");
  await page.until(`${time} !== ${JSON.stringify(before)}`, "time runs");
  await page.evaluate("document.querySelector('[data-viewer=play]').click()");
  assert.ok((await page.picture()) !== still, "it plays");
  assert.deepEqual(page.requests.filter((request) => request !== url && !request.startsWith("data:")), [], "no requests");
  assert.deepEqual(page.errors, [], "nothing in the console");
  const unlabelled = await page.evaluate(`[...document.querySelectorAll('input, button, select, canvas, img, svg')].filter((control) =>
    !(control.labels?.length || control.getAttribute('aria-label') || control.alt || control.textContent.trim())).length`);
  assert.equal(unlabelled, 0, "every control and picture has a name");
  await page.close();
  for (const [device, size] of Object.entries({ desktop: DESKTOP, phone: PHONE })) {
    for (const scheme of ["light", "dark"]) {
      const shown = await Page.open(browser, url, { size, scheme, offline: true });
      const overflow = await shown.evaluate("document.documentElement.scrollWidth - innerWidth");
      assert.ok(overflow <= 0, `${device}: the page is ${overflow} pixels too wide`);
      await shown.screenshot(`report-${device}-${scheme}.png`, false);
      await shown.fullScreenshot(`report-${device}-${scheme}-full.png`, size);
      assert.deepEqual(shown.errors, []);
      await shown.close();
    }
  }
}

async function startView() {
  const server = spawn(binary, ["view", run, "--port", "0", ...(body ? ["--body", body] : [])]);
  const url = await new Promise((done, failed) => {
    let printed = "";
    server.stdout.on("data", (data) => {
      printed += data;
      const found = printed.match(/http:\S+/);
      if (found) done(found[0]);
    });
    let said = "";
    server.stderr.on("data", (data) => { said += data; });
    server.on("exit", () => failed(new Error(said)));
  });
  return { server, url };
}

async function testView(browser) {
  const { server, url } = await startView();
  try {
    const page = await Page.open(browser, url);
    const viewer = "document.getElementById('viewer').viewer";
    const finest = "document.querySelector('[data-viewer=resolution]').value";
    const isFine = `${viewer}.shownMesh
      && document.querySelector('[data-viewer=pace]').textContent.includes(${finest} + ' cells')`;
    await page.until(isFine, "the field's mesh arrives, and is refined");
    const first = await page.picture();
    await page.set("Left arm: Raise", 60);
    await page.picture();
    // The field's surface comes to lie where the skinned one does: the pose that was sent is the pose that is seen.
    const apart = `(() => {
      const viewer = ${viewer};
      const skinned = viewer.avatar.bounds(viewer.avatar.jointRows(viewer.pose()));
      const box = viewer.shownMesh.box;
      return Math.max(...[0, 1].flatMap((end) => [0, 1, 2].map((axis) => Math.abs(skinned[end][axis] - box[end][axis]))));
    })()`;
    await page.until(`${isFine} && ${apart} < 0.03`, "the field's mesh of the new pose arrives");
    assert.ok((await page.picture()) !== first, "it has the new pose");
    await page.screenshot("view-posed.png", false);
    // What plays is the skinned mesh: nothing is asked of the fields until it rests.
    const clock = "document.querySelector('[data-viewer=time]').value";
    const asked = () => page.requests.filter((request) => request.endsWith("/mesh")).length;
    const [before, start] = [asked(), await page.evaluate(clock)];
    await page.evaluate("document.querySelector('[data-viewer=play]').click()");
    await page.until(`${clock} > Number(${start}) + 0.5 && !${viewer}.shownMesh`, "the skinned mesh plays");
    assert.equal(asked(), before, "no mesh is asked for while it plays");
    await page.screenshot("view-playing.png", false);
    await page.evaluate("document.querySelector('[data-viewer=play]').click()");
    await page.until(isFine, "the field's mesh of the pose in which it was stopped arrives");
    await page.evaluate("document.querySelector('[data-viewer=field]').click()");
    await page.until(`!${viewer}.shownMesh`, "the skinned mesh is shown again");
    assert.deepEqual(page.errors, [], "nothing in the console");
    assert.deepEqual(page.requests.filter((request) => !request.startsWith(url) && !request.startsWith("data:")), []);
    await page.close();
    for (const [device, size] of Object.entries({ desktop: DESKTOP, phone: PHONE })) {
      for (const scheme of ["light", "dark"]) {
        const shown = await Page.open(browser, url, { size, scheme });
        await shown.until(isFine, `the field's mesh arrives, ${device}, ${scheme}`);
        await shown.screenshot(`view-${device}-${scheme}.png`, false);
        assert.deepEqual(shown.errors, []);
        await shown.close();
      }
    }
  } finally {
    const ended = new Promise((done) => { server.on("exit", done); });
    server.kill("SIGINT");
    assert.equal(await ended, 0, "Ctrl-C ends the server cleanly");
  }
}

const browser = new Browser();
try {
  await testReport(browser);
  console.log("report: opens without a network, moves, and says nothing in the console");
  await testView(browser);
  console.log("view: plays the skinned mesh, and shows the field's of a pose that rests");
  console.log(`pictures: ${out}`);
} finally {
  await browser.close();
}
