// The levels at the pins: what the chip drives, what the world drives, and the pulls where neither does.
// rp2040js keeps outputs and inputs apart; here a pin has one level, which its input sees, too.

const INPUT_ENABLE = 1 << 6;

export class Pads {
  // `before` are the pads up to a reset, which the world goes on driving.
  constructor(machine, rp2040, pio, before) {
    this.machine = machine;
    this.pio = pio;
    this.pins = rp2040.gpio;
    this.external = before?.external ?? this.pins.map(() => null);
    this.levels = before?.levels ?? this.pins.map(() => false);
    this.conflicting = this.pins.map(() => false);
    // What the peripherals see of all pins.
    this.inputs = 0;
    for (const pin of this.pins) {
      // Enabled after a reset, which rp2040js forgets.
      pin.padValue |= INPUT_ENABLE;
      pin.checkForUpdates = () => this.update(pin.index);
      pin.refreshInput = () => this.update(pin.index);
    }
    Object.defineProperty(rp2040, 'gpioValues', { get: () => this.inputs });
    for (const pin of this.pins) {
      this.update(pin.index);
    }
  }

  // A level from outside, or `null` where nothing drives the pin from there.
  drive(index, isHigh) {
    this.external[index] = isHigh;
    this.update(index);
  }

  isOutput(index) {
    const pin = this.pins[index];
    return pin.outputEnable && !pin.outputDisable;
  }

  level(index) {
    const pin = this.pins[index];
    if (this.isOutput(index)) {
      return pin.outputValue;
    }
    if (this.external[index] !== null) {
      return this.external[index];
    }
    // With both pulls the pin keeps its level.
    return pin.pullupEnabled && (!pin.pulldownEnabled || this.levels[index]);
  }

  update(index) {
    const pin = this.pins[index];
    const level = this.level(index);
    const isDriven = this.external[index] !== null;
    const isConflicting = isDriven && this.isOutput(index);
    if (isConflicting && !this.conflicting[index]) {
      this.machine.conflict(index);
    }
    this.conflicting[index] = isConflicting;
    if (level !== this.levels[index]) {
      this.levels[index] = level;
      this.machine.edge(index, level, isDriven);
    }
    if (level !== pin.rawInputValue) {
      this.pio.pinChanges(index);
      pin.rawInputValue = level;
    }
    const input = pin.inputValue;
    if (input !== ((this.inputs >> index) & 1) > 0) {
      this.inputs ^= 1 << index;
      pin.setInputValue(level);
    }
  }
}
