// A host at the USB plug, with a driver for serial ports (CDC-ACM). It drives rp2040js' controller by its registers and its memory. The
// host of rp2040js itself takes every packet at once and knows no parity, so that a host which reads nothing could not be had.

// A packet of 64 bytes at 12 Mbit/s with its token and its handshake: 16 of them fit a millisecond, of 19 that may.
const PACKET_CYCLES = 7_812;
// From one look for a device to the next, and from a reset of the bus to the first transfer. Real hosts wait for longer.
const PAUSE_CYCLES = 125_000;

const [MAIN_CTRL_ENABLE, SIE_PULLUP] = [1 << 0, 1 << 16];
const [CONNECTED, SETUP_REC, BUS_RESET, RESUME, SUSPENDED] = [1 << 16, 1 << 17, 1 << 19, 1 << 11, 1 << 4];
const [SIE_STATUS, EP_STALL_ARM] = [0x50, 0x68];
const [FULL, ODD, AVAILABLE, LENGTH] = [1 << 15, 1 << 13, 1 << 10, 0x3ff];
const CONTROLS = 0x80;
const PACKET = 64;
// Buffers, by their place in the row of their controls.
const [CONTROL_IN, CONTROL_OUT] = [0, 1];
const ADDRESS = 5;
const SET_CONFIGURATION = 9;

const get = (type, index, length) => ({ setup: [0x80, 6, index, type, 0, 0, length & 0xff, length >> 8] });
const coding = [0x40, 0x42, 0x0f, 0, 0, 0, 8];
// What Linux asks when a device is plugged in, and when a program opens the port. A device of full speed alone refuses the qualifier.
const SET_UP = [
  get(1, 0, 64),
  { setup: [0, 5, ADDRESS, 0, 0, 0, 0, 0] },
  get(1, 0, 18),
  { ...get(6, 0, 10), isRefused: true },
  get(2, 0, 9),
  get(2, 0, 255),
  get(3, 0, 255),
  get(3, 1, 255),
  get(3, 2, 255),
  { setup: [0, SET_CONFIGURATION, 1, 0, 0, 0, 0, 0] },
  { setup: [0x21, 0x20, 0, 0, 0, 0, 7, 0], data: coding },
  { setup: [0xa1, 0x21, 0, 0, 0, 0, 7, 0], expected: coding },
  { setup: [0x21, 0x22, 3, 0, 0, 0, 0, 0] },
];

export class Usb {
  // `before` is the host up to a reset of the chip, which it sees as a device that was taken away and comes back.
  constructor(machine, rp2040, before) {
    this.machine = machine;
    this.rp2040 = rp2040;
    this.usb = rp2040.usbCtrl;
    this.isPlugged = before?.isPlugged ?? false;
    this.isNoisy = before?.isNoisy ?? false;
    this.isReading = true;
    this.isAwake = true;
    this.line = [];
    this.forget();
    this.watch();
    if (this.isPlugged) {
      this.later(PAUSE_CYCLES, () => this.look());
    }
  }

  forget() {
    this.transfers = [];
    this.transfer = null;
    this.isSetUp = false;
    this.isStalled = false;
    this.isBusy = false;
    // Buffers that the device has given away.
    this.armed = new Set();
    // The parities that the next packets must have.
    this.parities = new Map();
    this.endpoints = null;
  }

  watch() {
    const { usb } = this;
    usb.DPRAMUpdated = (offset, value) => {
      if (offset >= CONTROLS && offset < CONTROLS + 128) {
        const buffer = (offset - CONTROLS) / 4;
        if (value & AVAILABLE) {
          this.armed.add(buffer);
          this.kick();
        } else {
          this.armed.delete(buffer);
        }
      }
    };
    usb.onResetReceived = () => this.later(PAUSE_CYCLES, () => this.begin());
    // Registers of the pads, which rp2040js has not.
    const pads = new Map([[0x7c, 0], [0x80, 0]]);
    const { readUint32, writeUint32 } = usb;
    usb.readUint32 = (offset) => pads.get(offset) ?? readUint32.call(usb, offset);
    usb.writeUint32 = (offset, value) => {
      if (pads.has(offset)) {
        pads.set(offset, value);
        return;
      }
      writeUint32.call(usb, offset, value);
      if (offset === EP_STALL_ARM && value !== 0) {
        this.isStalled = true;
        this.kick();
      }
      // Of a bus that is never quiet the controller does not see the end of its reset, but for its own pads: erratum E5.
      if (offset === SIE_STATUS && usb.rawWriteValue & BUS_RESET && this.isNoisy) {
        usb.sieStatus &= ~CONNECTED;
      }
    };
  }

  // What happens at the plug.
  apply(what) {
    const { usb } = this;
    switch (what) {
      case 'plugged':
      case 'plugged_into_noisy_hub':
        this.isPlugged = true;
        this.isAwake = true;
        this.isNoisy = what === 'plugged_into_noisy_hub';
        this.look();
        break;
      case 'unplugged':
        this.isPlugged = false;
        this.forget();
        this.setStatus(SUSPENDED);
        break;
      case 'suspended':
        this.isAwake = false;
        this.setStatus(SUSPENDED);
        break;
      case 'resumed':
        usb.sieStatus &= ~SUSPENDED;
        this.isAwake = true;
        this.setStatus(RESUME);
        this.kick();
        break;
      case 'deaf':
      case 'reading':
        this.isReading = what === 'reading';
        this.kick();
        break;
    }
  }

  send(bytes) {
    if (!this.isSetUp) {
      this.machine.unmodelled.add('USB: bytes for a device that is not set up');
      return;
    }
    this.line.push(...bytes);
    this.kick();
  }

  later(cycles, action) {
    const { machine } = this;
    machine.stimuli.add(machine.now + cycles, () => {
      if (machine.chip.usb === this) {
        action();
      }
    });
  }

  setStatus(bits) {
    this.usb.sieStatus |= bits;
    this.usb.sieStatusUpdated();
  }

  // Waits for the device's pull-up.
  look() {
    const { usb } = this;
    if (!this.isPlugged) {
      return;
    }
    if (usb.mainCtrl & MAIN_CTRL_ENABLE && usb.sieCtrl & SIE_PULLUP) {
      this.forget();
      usb.sieStatus &= ~(CONNECTED | SUSPENDED);
      this.setStatus(BUS_RESET);
    } else {
      this.later(PAUSE_CYCLES, () => this.look());
    }
  }

  begin() {
    if (!(this.usb.sieStatus & CONNECTED)) {
      this.later(PAUSE_CYCLES, () => this.begin());
      return;
    }
    this.transfers = [...SET_UP];
    this.kick();
  }

  // Has the next packet go, when the one before is over.
  kick() {
    if (!this.isBusy && this.isPlugged && this.isAwake) {
      this.isBusy = true;
      this.later(PACKET_CYCLES, () => {
        this.isBusy = false;
        if (this.isPlugged && this.isAwake && this.step()) {
          this.kick();
        }
      });
    }
  }

  // One packet, if there is any to be had.
  step() {
    if (this.transfer !== null) {
      return this.goOn();
    }
    if (this.transfers.length !== 0) {
      this.start(this.transfers.shift());
      return false;
    }
    if (!this.isSetUp) {
      return false;
    }
    const { to, from } = this.endpoints;
    if (this.line.length !== 0 && this.armed.has(to)) {
      this.put(to, this.line.splice(0, PACKET));
      return true;
    }
    if (this.isReading && this.armed.has(from)) {
      this.machine.usb.push(...this.take(from));
      return true;
    }
    return false;
  }

  start({ setup, data, expected, isRefused }) {
    const length = setup[6] | (setup[7] << 8);
    this.transfer = { setup, data, expected, isRefused, length, isIn: setup[0] >= 0x80, bytes: [], isEnding: data === undefined && length === 0 };
    this.isStalled = false;
    this.parities.set(CONTROL_IN, 1).set(CONTROL_OUT, 1);
    this.armed.delete(CONTROL_IN);
    this.armed.delete(CONTROL_OUT);
    this.rp2040.usbDPRAM.set(setup);
    this.setStatus(SETUP_REC);
  }

  goOn() {
    const { transfer } = this;
    if (this.isStalled) {
      return this.finish();
    }
    // The end of a transfer goes the other way.
    if (transfer.isIn === transfer.isEnding) {
      if (!this.armed.has(CONTROL_OUT)) {
        return false;
      }
      this.put(CONTROL_OUT, transfer.isEnding ? [] : transfer.data);
      if (transfer.isEnding) {
        return this.finish();
      }
      transfer.isEnding = true;
      return true;
    }
    if (!this.armed.has(CONTROL_IN)) {
      return false;
    }
    const packet = this.take(CONTROL_IN);
    if (transfer.isEnding) {
      return this.finish();
    }
    transfer.bytes.push(...packet);
    if (packet.length < PACKET || transfer.bytes.length >= transfer.length) {
      transfer.isEnding = true;
      this.parities.set(CONTROL_OUT, 1);
    }
    return true;
  }

  finish() {
    const { setup, expected, isRefused, bytes } = this.transfer;
    this.transfer = null;
    if (this.isStalled !== (isRefused ?? false)) {
      this.complain(`the request ${setup} was ${this.isStalled ? 'refused' : 'taken'}`);
    }
    if (expected !== undefined && expected.join() !== bytes.join()) {
      this.complain(`the request ${setup} was answered ${bytes}`);
    }
    if (setup[1] === 6 && setup[3] === 2 && bytes.length > 9) {
      this.findEndpoints(bytes);
    }
    if (this.transfers.length === 0) {
      const isAddressed = (this.usb.addrEndp & 0x7f) === ADDRESS;
      if (this.endpoints === null || !isAddressed) {
        this.complain('no address, or no endpoints of data');
      } else {
        this.isSetUp = true;
        this.machine.usbSetUps.push(this.machine.now);
      }
    }
    return true;
  }

  // Both endpoints in bulk of the class's interface of data.
  findEndpoints(descriptors) {
    let isData = false;
    const found = {};
    for (let at = 0; at < descriptors.length; at += descriptors[at] || descriptors.length) {
      const [, type, address, kind, , interfaceClass] = descriptors.slice(at);
      if (type === 4) {
        isData = interfaceClass === 0x0a;
      } else if (type === 5 && isData && kind === 2) {
        found[address >= 0x80 ? 'from' : 'to'] = 2 * (address & 0xf) + (address >= 0x80 ? 0 : 1);
      }
    }
    this.endpoints = found.to === undefined || found.from === undefined ? null : found;
    this.parities.set(found.to, 0).set(found.from, 0);
  }

  complain(what) {
    this.machine.unmodelled.add(`USB: ${what}`);
  }

  // Where a buffer's packet is.
  place(buffer) {
    if (buffer <= CONTROL_OUT) {
      return 0x100;
    }
    const control = this.rp2040.usbDPRAMView.getUint32(4 * buffer, true);
    if (control >>> 31 === 0) {
      this.complain(`the endpoint of buffer ${buffer} is off`);
    }
    return control & 0xffc0;
  }

  // The device's packet of a buffer.
  take(buffer) {
    const control = this.finishBuffer(buffer, (value) => value & ~FULL);
    if (!(control & FULL)) {
      this.complain(`buffer ${buffer} was given away empty`);
    }
    const place = this.place(buffer);
    return [...this.rp2040.usbDPRAM.slice(place, place + (control & LENGTH))];
  }

  // The host's packet into a buffer.
  put(buffer, bytes) {
    this.rp2040.usbDPRAM.set(bytes, this.place(buffer));
    this.finishBuffer(buffer, (value) => (value & ~LENGTH) | FULL | bytes.length);
  }

  finishBuffer(buffer, change) {
    const { usb, rp2040, parities, armed } = this;
    const offset = CONTROLS + 4 * buffer;
    const control = rp2040.usbDPRAMView.getUint32(offset, true);
    if ((control & ODD ? 1 : 0) !== parities.get(buffer)) {
      this.complain(`a packet of buffer ${buffer} came twice, or one is missing`);
    }
    parities.set(buffer, 1 - parities.get(buffer));
    armed.delete(buffer);
    rp2040.usbDPRAMView.setUint32(offset, change(control) & ~AVAILABLE, true);
    usb.buffStatus |= 1 << buffer;
    usb.buffStatusUpdated();
    return control;
  }
}
