//! The firmware of the controller: wires the library to the STM32F405.
//!
//! On a host the same binary prints the pin-out, the defaults and the numbers of the link.
#![cfg_attr(target_os = "none", no_std, no_main)]

mod board;
#[cfg(not(target_os = "none"))]
mod schema_print;
#[cfg(target_os = "none")]
mod wiring;

#[cfg(not(target_os = "none"))]
fn main() {
    use rotorlead::{link, settings::Settings};

    println!("Pins of the STM32F405RG");
    for pin in &board::pinout::PINS {
        println!("  {:<5} {:<10} {}", pin.name, pin.function, pin.use_);
    }
    println!("\nInterrupts, highest priority first");
    for (name, what) in board::pinout::INTERRUPTS {
        println!("  {name:<7} {what}");
    }
    println!("\nDefault settings\n{:#?}", Settings::default());
    println!("\nLink: version {}, frames of up to {} bytes", link::VERSION, link::FRAME_BYTES);
    println!("  injection: {} requests of {} samples under way", link::INJECT_WINDOW, link::INJECT_SAMPLES);
    print!("{}", schema_print::Messages);
}

/// Tasks and what they share. Priorities: capture 4, control 3, bytes of the link 2, idle 0.
#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use core::sync::atomic::{AtomicBool, Ordering};

    use defmt_rtt as _;
    use heapless::spsc::{Consumer, Producer, Queue};
    use rotorlead::controller::{INJECT_QUEUE, RECORD_QUEUE, Server};
    use rotorlead::link::Sample;
    use rotorlead::throttle::Command;
    use stm32f4xx_hal::pac::Interrupt;

    use crate::board::serial::{RECEIVE_QUEUE, SEND_QUEUE, Serial};
    use crate::board::settings_flash::SettingsFlash;
    use crate::board::{Board, Queues};
    use crate::wiring::{Control, Inputs, Wires, start};

    type CommandQueue = Queue<Command, INJECT_QUEUE>;

    /// Set by the idle task whenever it comes round, and cleared by the control task.
    static IDLE_LIVES: AtomicBool = AtomicBool::new(false);

    #[shared]
    struct Shared {
        inputs: Inputs,
        control: Control,
        serial: Option<Serial>,
    }

    #[local]
    struct Local {
        server: Server<SettingsFlash>,
        facts: rotorlead::controller::Facts,
        received: Consumer<'static, u8, RECEIVE_QUEUE>,
        to_send: Producer<'static, u8, SEND_QUEUE>,
    }

    #[init(local = [
        receive_queue: Queue<u8, RECEIVE_QUEUE> = Queue::new(),
        send_queue: Queue<u8, SEND_QUEUE> = Queue::new(),
        inject_queues: [CommandQueue; 4] = [const { Queue::new() }; 4],
        output_queues: [CommandQueue; 4] = [const { Queue::new() }; 4],
        sample_queue: Queue<Sample, RECORD_QUEUE> = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let (received_in, received) = cx.local.receive_queue.split();
        let (to_send, to_send_out) = cx.local.send_queue.split();
        let queues = Queues { received: received_in, to_send: to_send_out };
        let board = Board::new(cx.device, cx.core, queues);
        defmt::info!("started: {}, {}", board.start_reason, board.clocks);
        let inject = cx.local.inject_queues.each_mut().map(Queue::split);
        let outputs = cx.local.output_queues.each_mut().map(Queue::split);
        let parts = start(board, inject, outputs, cx.local.sample_queue.split());
        defmt::info!("settings: {}", defmt::Debug2Format(&parts.origin));
        let shared = Shared { inputs: parts.inputs, control: parts.control, serial: parts.serial };
        (shared, Local { server: Server::new(parts.desk), facts: parts.facts, received, to_send })
    }

    /// Talks to the host, and does whatever takes long.
    #[idle(
        shared = [inputs, control, serial],
        local = [
            server, facts, received, to_send,
        ]
    )]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources { server, facts, received, to_send, .. } = cx.local;
        let idle::SharedResources { inputs, control, serial, .. } = cx.shared;
        let mut wires = Wires { inputs, control, serial, facts: *facts };
        loop {
            IDLE_LIVES.store(true, Ordering::Relaxed);
            while to_send.ready() {
                let Some(byte) = server.next_byte() else { break };
                let _ = to_send.enqueue(byte);
            }
            if to_send.len() > 0 {
                rtic::pend(Interrupt::USART3);
            }
            server.turn(|| received.dequeue(), &mut wires);
        }
    }

    /// Edges of the inputs. They are stamped by the hardware; this has until the next edge of the same input, 20 µs at
    /// least, to take the stamp away. A stamp that is overwritten is seen and counted.
    #[task(binds = TIM2, priority = 4, shared = [inputs])]
    fn capture(mut cx: capture::Context) {
        cx.shared.inputs.lock(Inputs::capture);
    }

    /// The control task: newest pulse of each input, through its channel, to its output.
    ///
    /// Deadline: the next tick, 200 µs at 5 kHz. When it is missed the outputs repeat their last pulse and the filters
    /// lose a step of time; it is counted and reported as `missed_deadlines`. Two in a row end an excitation. When it is
    /// missed for 20 ms on end the watchdog resets the controller: its pins float, and are pulled down outside.
    #[task(binds = SysTick, priority = 3, shared = [inputs, control])]
    fn control(cx: control::Context) {
        (cx.shared.inputs, cx.shared.control).lock(|inputs, control| {
            control.run(inputs, IDLE_LIVES.swap(false, Ordering::Relaxed));
        });
    }

    /// One byte of the link each way: 10 µs at 1 Mbaud.
    #[task(binds = USART3, priority = 2, shared = [serial])]
    fn link_byte(mut cx: link_byte::Context) {
        cx.shared.serial.lock(|serial| {
            if let Some(serial) = serial {
                serial.exchange();
            }
        });
    }
}
