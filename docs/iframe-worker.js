// SPDX-License-Identifier: Apache-2.0
// A browser starts no worker from a file, and the search of the theme is one. Where the site is read without a server, a
// frame that nobody sees takes its place: the script runs in it, and messages pass between it and the page.
(() => {
  if (location.protocol !== "file:") return;

  class FrameWorker extends EventTarget {
    constructor(url) {
      super();
      this.onmessage = null;
      const frame = document.body.appendChild(document.createElement("iframe"));
      frame.hidden = true;
      frame.title = "search";
      this.frame = frame;
      const inside = frame.contentWindow;
      inside.postMessage = (data) => this.#pass(data);
      inside.importScripts = (...urls) => Promise.all(urls.map((one) => load(inside.document, one)));
      this.ready = load(inside.document, url);
    }

    postMessage(data) {
      this.ready = this.ready.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data })));
    }

    terminate() {
      this.frame.remove();
    }

    #pass(data) {
      const event = new MessageEvent("message", { data });
      this.dispatchEvent(event);
      if (this.onmessage) this.onmessage(event);
    }
  }

  function load(page, url) {
    return new Promise((resolve, reject) => {
      const script = page.createElement("script");
      script.src = url;
      script.onload = resolve;
      script.onerror = reject;
      page.body.appendChild(script);
    });
  }

  window.Worker = FrameWorker;
})();
