//! The crate `rp2040-emu`, in this process.

use rp2040_emu::{Config, Emulator, EmulatorBuilder};

use super::{CYCLES_PER_S, Conflict, Edge, Error, Fault, Flash, PINS, Region, Responder, Run, Trace, Write};

/// What the crate has of flash.
const FLASH_SIZE: usize = 2 << 20;
/// Where the vectors are: behind the second stage of the boot, which is not executed.
const VECTORS: u32 = 0x100;
const WAIT_FOR_INTERRUPT: u32 = 0xBF30;
/// Where the program counter is in what an exception pushes.
const STACKED_PC: u32 = 24;
const STACK_POINTER: usize = 13;
/// The number of an exception in the flags, and of the first that is an interrupt.
const EXCEPTION: u32 = 0x1FF;
const FIRST_INTERRUPT: u32 = 16;
/// The interrupts of the timer and of PIO.
const LEVEL_INTERRUPTS: u32 = 0x78F;
/// What a pin may be connected to.
const SIO: u32 = 5;
const PIO0: u32 = 6;
const PIO1: u32 = 7;
const RAM: u32 = 0x2000_0000;
const PERIPHERALS: u32 = 0x4000_0000;

pub(super) fn run(run: &Run, flash: &[Flash]) -> Result<Trace, Error> {
    let mut machine = Machine::new(run, flash)?;
    while machine.emulator.cycles() < run.until_cycle && machine.faults.is_empty() {
        machine.step()?;
    }
    Ok(machine.into_trace(run))
}

/// A pin that is driven from outside from a cycle on, or (`None`) is not any more.
#[derive(Clone, Copy)]
struct Stimulus {
    cycle: u64,
    pin: u8,
    level: Option<bool>,
}

/// A responder, and how many falls of its question have come.
struct Listener {
    responder: Responder,
    falls: u32,
}

/// The emulator, and how far the run is.
struct Machine {
    emulator: Emulator,
    /// What is still to come, latest first.
    inputs: Vec<Stimulus>,
    writes: Vec<Write>,
    /// Pins that are driven from outside, and their levels.
    driven: u32,
    driven_levels: u32,
    /// Pins that the chip drives, too.
    conflicting: u32,
    conflicts: Vec<Conflict>,
    listeners: Vec<Listener>,
    watched: u32,
    levels: u32,
    edges: Vec<Edge>,
    faults: Vec<Fault>,
}

impl Machine {
    fn new(run: &Run, flash: &[Flash]) -> Result<Self, Error> {
        let unsupported = [
            ("input of the UART", !run.uart_in.is_empty()),
            ("USB", !run.plug.is_empty()),
            ("voltages at the converter", !run.analog.is_empty()),
            ("a debugger", run.is_debugged),
            ("flash to write", run.power_cut.is_some()),
        ];
        if let Some((what, _)) = unsupported.into_iter().find(|(_, is_needed)| *is_needed) {
            return Err(Error::Unsupported(what));
        }
        // One instruction a step: between two of them the emulator looks at the world.
        let builder = EmulatorBuilder::new(Config { sys_clk_hz: CYCLES_PER_S as u32 }).step_quantum(1);
        let mut emulator = builder.build().map_err(|_| Error::Unsupported("serial execution"))?;
        emulator.reset();
        emulator.load_flash(&contents(flash)?);
        emulator.direct_boot_from_flash(VECTORS);
        let edges =
            run.inputs.iter().map(|edge| Stimulus { cycle: edge.cycle, pin: edge.pin, level: Some(edge.is_high) });
        let releases =
            run.releases.iter().map(|release| Stimulus { cycle: release.cycle, pin: release.pin, level: None });
        let mut inputs: Vec<_> = releases.chain(edges).collect();
        inputs.sort_by_key(|stimulus| std::cmp::Reverse(stimulus.cycle));
        let mut writes = run.writes.clone();
        writes.sort_by_key(|write| std::cmp::Reverse(write.cycle));
        let watched = run.watch.iter().fold(0, |pins, pin| pins | 1 << pin);
        let (edges, faults) = (Vec::new(), Vec::new());
        let mut listeners: Vec<_> =
            run.responders.iter().map(|responder| Listener { responder: responder.clone(), falls: 0 }).collect();
        listeners.iter_mut().filter_map(|listener| listener.responder.answers.as_mut()).for_each(|all| all.reverse());
        Ok(Self {
            emulator,
            inputs,
            writes,
            driven: 0,
            driven_levels: 0,
            conflicting: 0,
            conflicts: Vec::new(),
            listeners,
            watched,
            levels: 0,
            edges,
            faults,
        })
    }

    fn step(&mut self) -> Result<(), Error> {
        let cycle = self.emulator.cycles();
        self.stimulate(cycle);
        let pc = self.emulator.core(0).reg(15);
        let cycles = self.emulator.step().map_err(|_| Error::StandsStill { cycle })?;
        self.connect(cycle);
        self.trace_pins();
        self.forget_interrupt();
        self.look_at_core(pc);
        if cycles == 0 && self.faults.is_empty() { Err(Error::StandsStill { cycle }) } else { Ok(()) }
    }

    /// Does what the world outside does by now.
    fn stimulate(&mut self, cycle: u64) {
        while let Some(stimulus) = self.inputs.pop_if(|stimulus| stimulus.cycle <= cycle) {
            let pin = 1 << stimulus.pin;
            self.driven = if stimulus.level.is_some() { self.driven | pin } else { self.driven & !pin };
            let is_high = stimulus.level == Some(true);
            self.driven_levels = if is_high { self.driven_levels | pin } else { self.driven_levels & !pin };
        }
        while let Some(Write { address, value, .. }) = self.writes.pop_if(|write| write.cycle <= cycle) {
            if (RAM..PERIPHERALS).contains(&address) {
                self.emulator.poke(address, value);
            } else {
                self.emulator.mmio_write32(address, value);
            }
        }
    }

    /// Gives the pins the levels that the chip, the world and the pulls make. The emulator alone knows no pulls, and would take what the
    /// core says where the pin's function is another.
    fn connect(&mut self, cycle: u64) {
        let bus = &mut self.emulator.bus;
        // The bit of a pad that pulls its pin up.
        let pulled = bus.pads_bank0.pads.iter().enumerate().fold(0, |pins, (pin, pad)| pins | (pad >> 3 & 1) << pin);
        let enabled = [(SIO, bus.sio.gpio_oe), (PIO0, bus.pio[0].pad_oe), (PIO1, bus.pio[1].pad_oe)];
        let outputs = enabled.into_iter().fold(0, |outputs, (function, enabled)| {
            pins(enabled)
                .filter(|pin| bus.io_bank0.funcsel((*pin).into()) == function)
                .fold(outputs, |outputs, pin| outputs | 1 << pin)
        });
        let conflicting = outputs & self.driven;
        let begun = conflicting & !self.conflicting;
        self.conflicting = conflicting;
        self.conflicts.extend(pins(begun).map(|pin| Conflict { cycle, pin }));
        // What is driven from outside wins in the emulator; on the bench the chip's pins are the stronger.
        bus.external_gpio_in_mask = (self.driven | pulled) & !outputs;
        bus.external_gpio_in_override = (self.driven_levels & self.driven) | (pulled & !self.driven);
        let from_outside = bus.external_gpio_in_override & bus.external_gpio_in_mask;
        bus.gpio_in = bus.gpio_in & !bus.external_gpio_in_mask | from_outside;
    }

    fn trace_pins(&mut self) {
        let levels = self.emulator.bus.gpio_in;
        let changed = levels ^ self.levels;
        self.levels = levels;
        if changed == 0 {
            return;
        }
        let cycle = self.emulator.cycles();
        self.edges.extend(pins(changed & self.watched).map(|pin| Edge { cycle, pin, is_high: levels >> pin & 1 != 0 }));
        self.listen(changed & !levels & !self.driven, cycle);
    }

    /// Lets those answer whose questions are over with these falls.
    fn listen(&mut self, fallen: u32, cycle: u64) {
        for Listener { responder, falls } in &mut self.listeners {
            let pin = responder.pin;
            if fallen >> pin & 1 == 0 {
                continue;
            }
            *falls += 1;
            if *falls < responder.falls {
                continue;
            }
            *falls = 0;
            let answer = responder.answers.as_mut().and_then(Vec::pop).into_iter().flatten();
            let steps = answer.map(|drive| Stimulus { cycle: cycle + drive.after, pin, level: drive.level });
            self.inputs.extend(steps);
            self.inputs.sort_by_key(|stimulus| std::cmp::Reverse(stimulus.cycle));
        }
    }

    /// Keeps a handler from being entered again for the request that it serves: the emulator notes a request that still
    /// stands as a new one.
    fn forget_interrupt(&mut self) {
        let exception = self.emulator.cores[0].regs.xpsr & EXCEPTION;
        if let Some(line) = exception.checked_sub(FIRST_INTERRUPT)
            && LEVEL_INTERRUPTS >> line & 1 != 0
        {
            self.emulator.bus.nvics[0].clear_pending(line as u8);
        }
    }

    /// Notices a fault, and wakes the core that sleeps: in the emulator, PIO sleeps with it. Firmware looks again at what
    /// it waits for.
    fn look_at_core(&mut self, pc: u32) {
        let bus = &mut self.emulator.bus;
        bus.wfe_waiting[0] = false;
        let opcode = bus.peek32(pc & !3) >> (8 * (pc & 2)) & 0xFFFF;
        let core = &mut self.emulator.cores[0];
        let fault = if core.is_in_hardfault() {
            let stacked = core.reg(STACK_POINTER).wrapping_add(STACKED_PC);
            Some((bus.peek32(stacked), "hard fault"))
        } else if core.is_halted() && opcode != WAIT_FOR_INTERRUPT {
            Some((pc, "the core has halted"))
        } else {
            core.wake();
            None
        };
        let cycle = self.emulator.cycles();
        self.faults.extend(fault.map(|(pc, what)| Fault { cycle, pc, what: what.to_owned() }));
    }

    fn into_trace(mut self, run: &Run) -> Trace {
        let memory = run.memory.iter().map(|region| self.read(*region)).collect();
        Trace {
            cycles: self.emulator.cycles(),
            edges: self.edges,
            conflicts: self.conflicts,
            uart: self.emulator.drain_uart0_tx_log(),
            usb: Vec::new(),
            usb_set_ups: Vec::new(),
            boot_loader: None,
            resets: Vec::new(),
            faults: self.faults,
            handlers: Vec::new(),
            memory,
            flash_operations: 0,
            power_is_cut: false,
            unmodelled: Vec::new(),
        }
    }

    fn read(&self, region: Region) -> Vec<u8> {
        let byte = |address: u32| self.emulator.peek(address & !3).to_le_bytes()[(address & 3) as usize];
        (0..region.length).map(|index| byte(region.address + index)).collect()
    }
}

/// The numbers of some pins.
fn pins(bits: u32) -> impl Iterator<Item = u8> {
    (0..PINS).filter(move |pin| bits >> pin & 1 != 0)
}

/// The flash as a whole.
fn contents(flash: &[Flash]) -> Result<Vec<u8>, Error> {
    let mut contents = vec![0xFF; FLASH_SIZE];
    for Flash { offset, bytes } in flash {
        let start = *offset as usize;
        let place = contents.get_mut(start..start + bytes.len()).ok_or(Error::Unsupported("flash behind 2 MiB"))?;
        place.copy_from_slice(bytes);
    }
    Ok(contents)
}
