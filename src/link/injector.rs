//! The controller's end of an injection: which samples are accepted, and which outputs answer which request.

use super::{INJECT_SAMPLES, InjectRequest, Injected, Refusal, Series, Tagged};
use crate::throttle::EscCommand;

/// Requests that may be under way at once: while one is consumed, the next one arrives. The queue between the link and
/// the control tick must hold `INJECT_WINDOW * INJECT_SAMPLES` commands.
pub const INJECT_WINDOW: usize = 3;

/// An injection into a motor at rest whose queue stays empty for so long ends. One into a motor that turns has its hold
/// time.
pub const INJECT_TIMEOUT_MS: u32 = 1000;

/// Keeps the books of one motor's injection. It lives in the task of the link; commands go through one queue to the
/// control tick, which consumes one per tick and puts one output into another.
///
/// ```
/// use rotorlead::link::{InjectRequest, Injector, Series};
/// use rotorlead::throttle::Command;
/// let samples = Series::try_from(&[0, 1 << 28][..]).unwrap();
/// let mut injector = Injector::new();
/// injector.accept(7, &InjectRequest { motor: 0, first: 0, samples })?;
/// assert_eq!(injector.output(Command::ZERO.into()), None);
/// let reply = injector.output(Command::ONE.into()).unwrap();
/// assert_eq!((reply.tag, reply.message.outputs.as_slice()), (7, &[0, 1 << 29][..]));
/// # Ok::<(), rotorlead::link::Refusal>(())
/// ```
#[derive(Clone, Debug)]
pub struct Injector {
    /// Number of the sample that comes next.
    next: u32,
    under_way: heapless::Deque<Block, INJECT_WINDOW>,
    outputs: Series<INJECT_SAMPLES>,
}

#[derive(Clone, Copy, Debug)]
struct Block {
    tag: u8,
    first: u32,
    length: usize,
}

impl Injector {
    /// Nothing injected yet; made anew when a mode is set.
    #[must_use]
    pub const fn new() -> Self {
        Self { next: 0, under_way: heapless::Deque::new(), outputs: Series::new() }
    }

    /// Takes note of a request. When it is accepted, all its samples, clamped to commands, must be queued. An empty one
    /// is accepted and never answered by an output: answer it at once.
    ///
    /// # Errors
    /// [`Refusal::OutOfSequence`] and [`Refusal::WindowFull`]; then none of its samples may be queued.
    pub fn accept(&mut self, tag: u8, request: &InjectRequest) -> Result<(), Refusal> {
        if request.first != self.next {
            return Err(Refusal::OutOfSequence { expected: self.next });
        }
        let length = request.samples.len();
        if length > 0 {
            let block = Block { tag, first: request.first, length };
            self.under_way.push_back(block).map_err(|_| Refusal::WindowFull)?;
        }
        // At most INJECT_SAMPLES.
        self.next = self.next.wrapping_add(length as u32);
        Ok(())
    }

    /// Takes the output of the next tick, and gives the reply that is complete with it. An output that nothing asked
    /// for is dropped.
    pub fn output(&mut self, output: EscCommand) -> Option<Tagged<Injected>> {
        let block = *self.under_way.front()?;
        // A block has at most as many samples as there is room.
        let _ = self.outputs.push(output.to_bits());
        if self.outputs.len() < block.length {
            return None;
        }
        self.under_way.pop_front();
        let outputs = core::mem::take(&mut self.outputs);
        Some(Tagged { tag: block.tag, message: Injected { first: block.first, outputs } })
    }

    /// Tags of the requests whose outputs are still to come, oldest first.
    pub fn tags(&self) -> impl Iterator<Item = u8> {
        self.under_way.iter().map(|block| block.tag)
    }

    /// Whether outputs are still to come.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        !self.under_way.is_empty()
    }
}

impl Default for Injector {
    fn default() -> Self {
        Self::new()
    }
}
