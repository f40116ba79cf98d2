// A browser starts no Worker for a page that is opened from the disk: there, the search runs in a frame instead.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(address) {
      super()
      const base = new URL(address, location.href)
      const frame = document.createElement("iframe")
      frame.hidden = true
      document.body.append(frame)
      this.inside = frame.contentWindow
      const answer = (data) => setTimeout(() => this.answer(data))
      Object.assign(this.inside, { postMessage: answer, importScripts: (...others) => Promise.all(others.map(load)) })
      const load = (source) => new Promise((resolve, reject) => {
        const script = frame.contentDocument.createElement("script")
        Object.assign(script, { src: new URL(source, base).href, onload: resolve, onerror: reject })
        frame.contentDocument.head.append(script)
      })
      this.ready = load(base)
    }
    postMessage(data) {
      this.ready.then(() => this.inside.dispatchEvent(new MessageEvent("message", { data })))
    }
    answer(data) {
      const message = new MessageEvent("message", { data })
      this.dispatchEvent(message)
      if (this.onmessage) this.onmessage(message)
    }
    terminate() {}
  }
}
