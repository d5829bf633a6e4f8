// The cycles that each exception's handler takes. A call that interrupts another one counts as its own only.

export class Handlers {
  // Calls that begin before the cycle `from` are not counted.
  constructor(machine, from) {
    this.machine = machine;
    this.from = from;
    this.byException = new Map();
    // The calls that have not returned, the innermost last.
    this.open = [];
    this.isReturning = false;
  }

  // Watches a core, which has no calls yet.
  watch(cpu) {
    this.forget();
    const { exceptionEntry, exceptionReturn } = cpu;
    cpu.exceptionEntry = (number) => {
      exceptionEntry.call(cpu, number);
      this.enter(number);
    };
    cpu.exceptionReturn = (value) => {
      exceptionReturn.call(cpu, value);
      this.isReturning = true;
    };
  }

  // The core is reset.
  forget() {
    this.open = [];
    this.isReturning = false;
  }

  enter(exception) {
    const start = this.machine.now;
    if (!this.byException.has(exception)) {
      this.byException.set(exception, { exception, first_cycle: start, calls: 0, total_cycles: 0, most_cycles: 0 });
    }
    this.open.push({ exception, start, inner: 0 });
  }

  // After an instruction that ends at the cycle `now`.
  leave(now) {
    this.isReturning = false;
    const { exception, start, inner } = this.open.pop();
    const own = now - start - inner;
    if (this.open.length !== 0) {
      this.open.at(-1).inner += now - start;
    }
    if (start >= this.from) {
      const handler = this.byException.get(exception);
      handler.calls++;
      handler.total_cycles += own;
      handler.most_cycles = Math.max(handler.most_cycles, own);
    }
  }

  trace() {
    return [...this.byException.values()].sort((a, b) => a.exception - b.exception);
  }
}
