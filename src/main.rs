//! The firmware of the controller: wires the library to the STM32F405.
//!
//! On a host the same binary prints the pin-out, the defaults and the numbers of the link.
#![cfg_attr(target_os = "none", no_std, no_main)]

mod board;
#[cfg(not(target_os = "none"))]
mod schema_print;

#[cfg(not(target_os = "none"))]
fn main() {
    use board::generated::{INTERRUPTS, PINS, TITLE};
    use rotorlead::{link, settings::Settings};

    println!("Pins of the {TITLE}");
    for [name, function, connect, level] in PINS {
        println!("  {name:<5} {function:<10} {connect} ({level})");
    }
    println!("\nInterrupts, highest priority first");
    for [priority, name, task, _] in INTERRUPTS {
        println!("  {name:<7} {task}, priority {priority}");
    }
    println!("\nDefault settings\n{:#?}", Settings::default());
    println!("\nLink: version {}, frames of up to {} bytes", link::VERSION, link::FRAME_BYTES);
    println!("  injection: {} requests of {} samples under way", link::INJECT_WINDOW, link::INJECT_SAMPLES);
    print!("{}", schema_print::Messages);
}

/// Tasks and what they share. Priorities: supply 6, bytes of the link 5, capture 4, control 3, idle 0.
///
/// The bytes come before the pulses: one comes every 10 µs at 1 Mbaud, and the UART holds one more, while an edge that is
/// stamped by the hardware has 20 µs, and a control tick with an excitation takes longer than either.
#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use core::sync::atomic::{AtomicBool, Ordering};

    use defmt_rtt as _;
    use heapless::spsc::{Consumer, Producer, Queue};
    use rotorlead::controller::{self, Control, ControlHandle, INJECT_QUEUE, Inputs, RECORD_QUEUE, Server, Started};
    use rotorlead::link::Sample;
    use rotorlead::settings::{MOTORS, Store};
    use rotorlead::throttle::{Command, EscCommand};
    use stm32f4xx_hal::pac::Interrupt;

    use crate::board::capture::Capture;
    use crate::board::serial::{RECEIVE_QUEUE, SEND_QUEUE, Serial};
    use crate::board::settings_flash::{COPIES, SettingsFlash};
    use crate::board::{Board, BoardStatus, Queues, Stm32f405, postmortem};

    #[shared]
    struct Shared {
        inputs: Inputs<Capture>,
        control: Control<Stm32f405>,
        /// Set by the idle task whenever it comes round, and cleared by the control task.
        idle_ran: AtomicBool,
    }

    #[local]
    struct Local {
        server: Server<SettingsFlash>,
        status: BoardStatus,
        received: Consumer<'static, u8, RECEIVE_QUEUE>,
        to_send: Producer<'static, u8, SEND_QUEUE>,
        serial: Option<Serial>,
    }

    #[init(local = [
        receive_queue: Queue<u8, RECEIVE_QUEUE> = Queue::new(),
        send_queue: Queue<u8, SEND_QUEUE> = Queue::new(),
        inject_queues: [Queue<Command, INJECT_QUEUE>; MOTORS] = [const { Queue::new() }; MOTORS],
        output_queues: [Queue<EscCommand, INJECT_QUEUE>; MOTORS] = [const { Queue::new() }; MOTORS],
        sample_queue: Queue<Sample, RECORD_QUEUE> = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let (received_in, received) = cx.local.receive_queue.split();
        let (to_send, to_send_out) = cx.local.send_queue.split();
        let queues = Queues { received: received_in, to_send: to_send_out };
        let Board { capture, control, serial, flash, status } = Board::new(cx.device, cx.core, queues);
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
        let local = Local { server: Server::new(handler), status, received, to_send, serial };
        (Shared { inputs, control, idle_ran: AtomicBool::new(false) }, local)
    }

    /// Talks to the host, and does whatever takes long. Sleeps where there is nothing to do: a tick or a byte wakes it.
    #[idle(shared = [inputs, control, &idle_ran], local = [server, status, received, to_send])]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources { server, status, received, to_send, .. } = cx.local;
        let idle::SharedResources { inputs, mut control, idle_ran, .. } = cx.shared;
        control.lock(Control::start_ticks);
        let mut board = ControlHandle { inputs, control, hardware: status };
        loop {
            idle_ran.store(true, Ordering::Relaxed);
            while to_send.ready() {
                let Some(byte) = server.next_byte() else { break };
                let _ = to_send.enqueue(byte);
            }
            if to_send.len() > 0 {
                rtic::pend(Interrupt::USART3);
            }
            if !server.poll(|_| received.dequeue(), &mut board) {
                // Not WFI: an interrupt since the look above is an event, and there is no sleep.
                cortex_m::asm::wfe();
            }
        }
    }

    /// The supply falls: outputs low, and a new start.
    #[task(binds = PVD, priority = 6)]
    fn supply(_: supply::Context) {
        postmortem::supply_low()
    }

    /// One byte of the link each way: 10 µs at 1 Mbaud.
    #[task(binds = USART3, priority = 5, local = [serial])]
    fn link_byte(cx: link_byte::Context) {
        if let Some(serial) = cx.local.serial {
            serial.handle_interrupt();
        }
    }

    /// Edges of the inputs. They are stamped by the hardware; this has until the next edge of the same input, 20 µs at
    /// least, to take the stamp away. A stamp that is overwritten is seen and counted.
    #[task(binds = TIM2, priority = 4, shared = [inputs])]
    fn capture(mut cx: capture::Context) {
        cx.shared.inputs.lock(|inputs| inputs.capture());
    }

    /// The control task: newest pulse of each input, through its channel, to its output.
    ///
    /// Deadline: the next tick, 200 µs at 5 kHz. When it is missed the outputs repeat their last pulse and the filters
    /// lose a step of time; it is counted and reported as `missed_deadlines`. Two in a row end an excitation. When it is
    /// missed for 20 ms on end the watchdog resets the controller: its pins float, and are pulled down outside.
    #[task(binds = SysTick, priority = 3, shared = [inputs, control, &idle_ran])]
    fn control(mut cx: control::Context) {
        // The captures wait only for this, and not for the filters.
        let readings = cx.shared.inputs.lock(Inputs::poll);
        // No swap: the lowest priority does not run between the two.
        let idle_ran = cx.shared.idle_ran.load(Ordering::Relaxed);
        cx.shared.idle_ran.store(false, Ordering::Relaxed);
        cx.shared.control.lock(|control| control.run(readings, idle_ran));
    }
}
