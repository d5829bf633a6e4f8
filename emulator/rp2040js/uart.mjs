// UART0. Bytes arrive at the speed that the firmware has set; sent bytes leave at once.

export class Uart {
  constructor(machine, rp2040) {
    this.machine = machine;
    [this.uart] = rp2040.uart;
    this.uart.onByte = (byte) => machine.uart.push(byte);
    storeRegisters(this.uart);
    correctTransmitInterrupt(this.uart);
  }

  // 16 samples a bit. A UART without a divider has no bits: any time will do, as the bytes are lost.
  cyclesPerBit() {
    return Math.round(16 * (this.uart.baudDivider || 1));
  }

  receive(byte) {
    const { uart, machine } = this;
    if (!uart.enabled || !uart.rxEnabled || !uart.baudDivider) {
      machine.unmodelled.add('UART0: bytes arrived that the firmware did not listen to');
    } else if (uart.rxFIFO.full) {
      machine.unmodelled.add('UART0: the receive FIFO overran');
    } else {
      uart.feedByte(byte);
    }
  }
}

// Registers that rp2040js has not, and that firmware sets or clears as a matter of course: errors of reception, of which
// there are none, and levels of interrupts and DMA, which it does not look at.
function storeRegisters(uart) {
  const stored = new Map([
    [0x04, 0],
    [0x34, 0x12],
    [0x48, 0],
  ]);
  const { readUint32, writeUint32 } = uart;
  uart.readUint32 = (offset) => stored.get(offset) ?? readUint32.call(uart, offset);
  uart.writeUint32 = (offset, value) => {
    if (stored.has(offset)) {
      stored.set(offset, offset === 0x04 ? 0 : value);
    } else {
      writeUint32.call(uart, offset, value);
    }
  };
}

// The interrupt of the sender comes when it runs empty (PL011 TRM, 2.8.2). rp2040js raises it for as long as it is empty, which is
// always, and so for ever.
function correctTransmitInterrupt(uart) {
  const [UARTDR, TXINTR] = [0x00, 1 << 5];
  uart.checkInterrupts = () => {
    uart.rp2040.setInterrupt(uart.irq, (uart.interruptStatus & uart.interruptMask) !== 0);
  };
  const { writeUint32 } = uart;
  uart.writeUint32 = (offset, value) => {
    writeUint32.call(uart, offset, value);
    if (offset === UARTDR) {
      uart.interruptStatus |= TXINTR;
      uart.checkInterrupts();
    }
  };
}
