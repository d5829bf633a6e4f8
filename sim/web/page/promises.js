// The engine speaks to the box by waiting for promises, which not every browser's WebAssembly can. Where it cannot, the engine is there all
// the same for everything else: the page offers no box then.

WebAssembly.Suspending ??= function Suspending(waits) {
  return waits;
};
WebAssembly.promising ??= (entered) => entered;
