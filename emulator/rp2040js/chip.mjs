// The chip from one reset to the next.

import { Core } from './core.mjs';
import { correct } from './corrections.mjs';
import { Pads } from './pads.mjs';
import { Pio } from './pio.mjs';
import { Rom } from './rom.mjs';
import { Uart } from './uart.mjs';
import { Usb } from './usb.mjs';
import { Watchdog } from './watchdog.mjs';

// At 125 MHz, which the boards run at. rp2040js counts time in nanoseconds, of which this is a whole number.
export const CYCLE_NS = 8;

const FLASH = 0x10000000;
// Behind the 256 bytes of the second stage of the boot.
const VECTORS = FLASH + 0x100;

export class Chip {
  // `before` is the chip up to a reset by the watchdog, which keeps its memory.
  constructor(machine, before) {
    this.rp2040 = new machine.rp2040js.RP2040();
    this.alarms = this.rp2040.clock;
    this.base = machine.now;
    if (before !== null) {
      for (const memory of ['flash', 'flash16', 'flashView', 'sram', 'sramView']) {
        this.rp2040[memory] = before.rp2040[memory];
      }
      this.rp2040.adc.channelValues = before.rp2040.adc.channelValues;
    }
    this.rp2040.logger = new Log(machine, this);
    correct(this.rp2040, machine.rp2040js);
    this.rom = new Rom(machine, this.rp2040);
    this.core = new Core(machine, this.rp2040, this.rom);
    this.pio = new Pio(this.rp2040);
    this.pads = new Pads(machine, this.rp2040, this.pio, before?.pads);
    this.uart = new Uart(machine, this.rp2040);
    this.usb = new Usb(machine, this.rp2040, before?.usb);
    this.watchdog = new Watchdog(machine, this.rp2040, before?.watchdog);
  }

  // What the second stage of the boot does. Neither it nor the boot ROM is executed.
  boot() {
    this.rp2040.core.VTOR = VECTORS;
    this.rp2040.core.reset();
  }

  read(address, length) {
    return Array.from({ length }, (_, index) => this.rp2040.readUint8(address + index));
  }
}

// Turns what rp2040js warns of into faults of the core, or into the list of what it does not model.
class Log {
  constructor(machine, chip) {
    this.machine = machine;
    this.chip = chip;
  }

  warn(component, text) {
    if (component === 'RP2040' || component === 'CortexM0Core') {
      this.chip.core.blame(text);
    } else {
      this.machine.unmodelled.add(`${component}: ${text}`);
    }
  }

  error(component, text) {
    this.warn(component, text);
  }

  debug() {}

  info() {}
}
