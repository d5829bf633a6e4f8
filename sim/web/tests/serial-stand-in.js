// In place of the browser's own serial ports: one that is wired to `portOpen`, `portWrite` and `portClose`, and gets `portBytes` and `portLost`. What it
// has of a port is what the page uses.

(() => {
  const toText = (bytes) => btoa(String.fromCharCode(...bytes));
  const toBytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  let source = null;
  const port = {
    readable: null,
    writable: null,
    getInfo: () => ({ usbVendorId: 0x1209, usbProductId: 1 }),
    async open({ baudRate }) {
      await window.portOpen(baudRate);
      port.readable = new ReadableStream({ start(controller) { source = controller; } });
      port.writable = new WritableStream({ write: (bytes) => window.portWrite(toText(bytes)) });
    },
    async close() {
      if (port.readable.locked || port.writable.locked) throw new TypeError("a stream is locked");
      source = null;
      await window.portClose();
    },
  };
  window.portLost = () => source?.error(new DOMException("The device has been lost.", "NetworkError"));
  window.portBytes = (text) => source?.enqueue(toBytes(text));
  Object.defineProperty(navigator, "serial", { value: { requestPort: async () => port } });
})();
