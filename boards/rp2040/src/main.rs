//! The firmware for an RP2040: wires the library to the pins of a Raspberry Pi Pico.
//!
//! On a host the same binary prints the pin-out.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "it lies where the boot ROM looks for it, and tells the core where its vectors are")]
mod boot;
#[cfg(target_os = "none")]
mod clocks;
#[cfg(target_os = "none")]
mod inputs;
#[cfg(target_os = "none")]
mod outputs;
#[cfg(target_os = "none")]
mod parts;
#[cfg(target_os = "none")]
mod pins;
#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "memory that survives a reset, and the handlers of faults")]
mod postmortem;
#[cfg(target_os = "none")]
mod serial;
#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "the flash is read at its addresses, and written by the boot ROM")]
mod settings_flash;
#[cfg(target_os = "none")]
mod start;
#[cfg(target_os = "none")]
mod state_machines;
#[cfg(target_os = "none")]
mod thrust_adc;
#[cfg(target_os = "none")]
mod usb;
#[cfg(target_os = "none")]
mod watchdog;
#[cfg(target_os = "none")]
mod wire;

#[cfg(not(target_os = "none"))]
fn main() {
    use rotorlead_rp2040::generated::{PINS, TITLE};

    println!("Pins of the {TITLE}");
    for [name, pico, connect, level] in PINS {
        let pico = if pico.is_empty() { String::new() } else { format!("pin {pico}") };
        println!("  {name:<5} {pico:<8} {connect} ({level})");
    }
}

/// Tasks and what they share. Priorities: control 4, bytes of the link by the UART 2 and by USB 1, idle 0.
///
/// The edges of the inputs wait in the queues of their state machines, 8 of each, until the control task takes them. That is an
/// exception of the core, which only a critical section keeps off: so a lock of the idle task lets no interrupt in at all. The UART
/// holds 32 bytes meanwhile, and a host waits for USB.
#[cfg(target_os = "none")]
#[rtic::app(device = rp2040_hal::pac, peripherals = true)]
mod app {
    use core::sync::atomic::{AtomicBool, Ordering};

    use defmt_rtt as _;
    use heapless::spsc::Queue;
    use rotorlead::controller::{
        self, Control, ControlHandle, INJECT_QUEUE, Inputs, LAMP_STEP_MS, Lamp, RECORD_QUEUE, Server, Started,
    };
    use rotorlead::link::Sample;
    use rotorlead::settings::{MOTORS, Store};
    use rotorlead::throttle::{Command, EscCommand};
    use rotorlead_rp2040::generated::LED;
    use rp2040_hal::pac::{Interrupt, TIMER};

    use crate::inputs::{Capture, EDGE_FIFO_DEPTH};
    use crate::parts::{BoardStatus, Rp2040};
    use crate::postmortem;
    use crate::serial::Serial;
    use crate::settings_flash::{COPIES, SettingsFlash};
    use crate::start::{Board, Queues};
    use crate::usb::{self, Usb};
    use crate::watchdog;
    use crate::wire::{RECEIVE_QUEUE, SEND_QUEUE, WIRES, Wire};

    /// How long the controller stays when the boot loader was asked for, so that the host gets its answer. Chosen: a host asks a USB
    /// device every millisecond, and a busy one some of them later.
    const LEAVE_US: u32 = 100_000;

    #[shared]
    struct Shared {
        inputs: Inputs<Capture>,
        control: Control<Rp2040>,
        /// Set by the idle task whenever it comes round, and cleared by the control task.
        idle_ran: AtomicBool,
    }

    #[local]
    struct Local {
        server: Server<SettingsFlash, WIRES>,
        status: BoardStatus,
        wires: [Wire; WIRES],
        serial: Serial,
        usb: Usb,
        timer: TIMER,
    }

    #[init(local = [
        receive_queues: [Queue<u8, RECEIVE_QUEUE>; WIRES] = [const { Queue::new() }; WIRES],
        send_queues: [Queue<u8, SEND_QUEUE>; WIRES] = [const { Queue::new() }; WIRES],
        inject_queues: [Queue<Command, INJECT_QUEUE>; MOTORS] = [const { Queue::new() }; MOTORS],
        output_queues: [Queue<EscCommand, INJECT_QUEUE>; MOTORS] = [const { Queue::new() }; MOTORS],
        sample_queue: Queue<Sample, RECORD_QUEUE> = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let [(received_uart, from_uart), (received_usb, from_usb)] =
            cx.local.receive_queues.each_mut().map(Queue::split);
        let [(to_uart, to_send_uart), (to_usb, to_send_usb)] = cx.local.send_queues.each_mut().map(Queue::split);
        let wires =
            [Wire::new(from_uart, to_uart, Interrupt::UART0_IRQ), Wire::new(from_usb, to_usb, Interrupt::USBCTRL_IRQ)];
        let queues = [
            Queues { received: received_uart, to_send: to_send_uart },
            Queues { received: received_usb, to_send: to_send_usb },
        ];
        let Board { capture, control, serial, usb, flash, status, timer } = Board::new(cx.device, cx.core, queues);
        let facts = status.facts;
        defmt::info!("started: {}", defmt::Debug2Format(&facts));
        let queues = controller::Queues {
            inject: cx.local.inject_queues.each_mut().map(Queue::split),
            outputs: cx.local.output_queues.each_mut().map(Queue::split),
            samples: cx.local.sample_queue.split(),
        };
        let store = Store::new(flash, COPIES);
        let Started { inputs, control, handler, origin } =
            controller::start(capture, control, store, &facts, queues, Some(postmortem::resume_source()));
        defmt::info!("settings: {}", defmt::Debug2Format(&origin));
        let local = Local { server: Server::new(handler), status, wires, serial, usb, timer };
        (Shared { inputs, control, idle_ran: AtomicBool::new(false) }, local)
    }

    /// Talks to the host, lights the lamp, and does whatever takes long. Sleeps where there is nothing to do: a tick or a byte wakes it.
    #[idle(shared = [inputs, control, &idle_ran], local = [server, status, wires, timer])]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources { server, status, wires, timer, .. } = cx.local;
        let idle::SharedResources { inputs, mut control, idle_ran, .. } = cx.shared;
        control.lock(Control::start_ticks);
        let mut board = ControlHandle { inputs, control: &mut control, hardware: status };
        let mut lamp_step = 0;
        let mut leaving_since = None;
        loop {
            idle_ran.store(true, Ordering::Relaxed);
            let microseconds = timer.timerawl().read().bits();
            if let Some(wire) = wires.get_mut(server.written_to()) {
                wire.send(|| server.next_byte(), microseconds);
            }
            if usb::IS_WAITING.load(Ordering::Relaxed) {
                rtic::pend(Interrupt::USBCTRL_IRQ);
            }
            let is_busy = server.poll(|wire| wires.get_mut(wire)?.receive(), &mut board);
            if server.is_leaving() && microseconds.wrapping_sub(*leaving_since.get_or_insert(microseconds)) >= LEAVE_US
            {
                watchdog::enter_boot_loader();
            }
            let milliseconds = microseconds / 1000;
            if milliseconds / LAMP_STEP_MS != lamp_step {
                lamp_step = milliseconds / LAMP_STEP_MS;
                show(&mut board, milliseconds);
            }
            if !is_busy {
                // Not WFI: an interrupt since the look above is an event, and there is no sleep.
                cortex_m::asm::wfe();
            }
        }
    }

    /// Lights the lamp, or not.
    fn show(board: &mut impl controller::ControlAccess, milliseconds: u32) {
        let is_bench_enabled = board.is_bench_enabled();
        let tells_pulses_apart = board.facts().clocks.tells_pulses_apart();
        let lamp = board.tick(|tick| Lamp::select(tick, is_bench_enabled, tells_pulses_apart));
        crate::pins::Pins::steal().put(LED, lamp.is_on(milliseconds));
    }

    /// Bytes of the link by USB.
    #[task(binds = USBCTRL_IRQ, priority = 1, local = [usb])]
    fn usb_bytes(cx: usb_bytes::Context) {
        cx.local.usb.handle_interrupt();
    }

    /// Bytes of the link by the UART.
    #[task(binds = UART0_IRQ, priority = 2, local = [serial])]
    fn link_bytes(cx: link_bytes::Context) {
        cx.local.serial.handle_interrupt();
    }

    /// The control task: newest pulse or frame of each input, through its channel, to its output.
    ///
    /// Deadline: the next tick, 200 µs at 5 kHz. When it is missed the outputs repeat their last pulse and the filters
    /// lose a step of time; it is counted and reported as `missed_deadlines`. Two in a row end an excitation. When it is
    /// missed for 20 ms on end the watchdog resets the controller: its pins are pulled down.
    #[task(binds = SysTick, priority = 4, shared = [inputs, control, &idle_ran])]
    fn control(mut cx: control::Context) {
        let readings = cx.shared.inputs.lock(|inputs| {
            let _ = (0..EDGE_FIFO_DEPTH).all(|_| inputs.capture());
            inputs.poll()
        });
        // No swap: the lowest priority does not run between the two.
        let idle_ran = cx.shared.idle_ran.load(Ordering::Relaxed);
        cx.shared.idle_ran.store(false, Ordering::Relaxed);
        cx.shared.control.lock(|control| control.run(readings, idle_ran));
    }
}
