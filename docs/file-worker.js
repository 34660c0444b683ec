// Browsers start no worker from a file: there the script of the search runs in a hidden frame.
if (location.protocol === "file:") {
  window.Worker = class {
    constructor(url) {
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.frame.srcdoc = "<!doctype html>";
      this.ready = new Promise((resolve, reject) => {
        this.frame.onload = () => {
          const inner = this.frame.contentWindow;
          inner.postMessage = (data) => setTimeout(() => this.onmessage?.({ data }));
          const script = inner.document.createElement("script");
          script.src = new URL(url, location);
          script.onload = () => resolve(inner);
          script.onerror = reject;
          inner.document.head.append(script);
        };
      });
      this.ready.catch((error) => this.onerror?.(error));
      document.documentElement.append(this.frame);
    }

    postMessage(data) {
      this.ready.then((inner) => inner.onmessage({ data }));
    }

    terminate() {
      this.frame.remove();
    }
  };
}
