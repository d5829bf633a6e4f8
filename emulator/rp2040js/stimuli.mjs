// What the world outside does to the chip, each at its cycle: edges at pins, voltages at the converter, bytes for the UART
// and for USB, what becomes of the plug, words put into memory.

const BITS_OF_A_BYTE = 10;

export class Stimuli {
  constructor() {
    this.queue = [];
    this.index = 0;
    // Bytes on the line, and when the last bit of the first of them has arrived.
    this.line = [];
    this.arrival = Infinity;
    this.update();
  }

  // What happens in a run, behind what is to happen at the same time anyway.
  extend(run) {
    this.queue = [
      ...this.queue.slice(this.index),
      ...run.inputs.map(({ cycle, pin, is_high }) => ({ cycle, apply: ({ chip }) => chip.pads.drive(pin, is_high) })),
      ...run.analog.map(({ cycle, input, count }) => ({
        cycle,
        apply: ({ chip }) => (chip.rp2040.adc.channelValues[input] = count),
      })),
      ...run.releases.map(({ cycle, pin }) => ({ cycle, apply: ({ chip }) => chip.pads.drive(pin, null) })),
      ...run.writes.map(({ cycle, address, value }) => ({
        cycle,
        apply: ({ chip }) => chip.rp2040.writeUint32(address, value),
      })),
      ...run.usb_in.map(({ cycle, bytes }) => ({ cycle, apply: ({ chip }) => chip.usb.send(bytes) })),
      ...run.plug.map(({ cycle, what }) => ({ cycle, apply: ({ chip }) => chip.usb.apply(what) })),
      ...run.uart_in.map(({ cycle, bytes }) => ({ cycle, apply: (machine) => this.send(machine, bytes) })),
    ].sort((a, b) => a.cycle - b.cycle);
    this.index = 0;
    this.update();
  }

  // Something that is to happen, be it in the middle of a run.
  add(cycle, apply) {
    let place = this.queue.length;
    while (place > this.index && this.queue[place - 1].cycle > cycle) {
      place--;
    }
    this.queue.splice(place, 0, { cycle, apply });
    this.update();
  }

  update() {
    const queued = this.index < this.queue.length ? this.queue[this.index].cycle : Infinity;
    this.next = Math.min(queued, this.arrival);
  }

  apply(machine) {
    while (this.index < this.queue.length && this.queue[this.index].cycle <= machine.now) {
      this.queue[this.index++].apply(machine);
    }
    if (this.arrival <= machine.now) {
      this.receive(machine);
    }
    this.update();
  }

  send(machine, bytes) {
    const isIdle = this.line.length === 0;
    this.line.push(...bytes);
    if (isIdle && bytes.length !== 0) {
      this.arrival = machine.now + machine.chip.uart.cyclesPerBit() * BITS_OF_A_BYTE;
    }
  }

  receive(machine) {
    const { uart } = machine.chip;
    uart.receive(this.line.shift());
    this.arrival = this.line.length === 0 ? Infinity : this.arrival + uart.cyclesPerBit() * BITS_OF_A_BYTE;
  }
}
