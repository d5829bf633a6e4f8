//! A chip that goes on from run to run, so that what happens to it may depend on what it has done.

use super::node::Node;
use super::{Drive, Error, Question, Run, Trace, image};

/// An RP2040 in rp2040js ([`super::Emulator::Node`]) that is run on piece by piece.
#[derive(Debug)]
pub struct Live {
    node: Node,
    /// Until when it has run.
    now: u64,
}

impl Live {
    /// Starts the image, and runs it to the end of a first run. Its responders and watched pins are those of all.
    ///
    /// # Errors
    /// As [`super::Emulator::run`].
    pub fn start(run: &Run, answer: impl FnMut(&Question) -> Vec<Drive>) -> Result<(Self, Trace), Error> {
        run.check()?;
        let flash = image::flash(run)?;
        let mut node = Node::installed()?;
        let trace = node.run(run, &flash, answer)?;
        Ok((Self { node, now: trace.cycles }, trace))
    }

    /// Runs on for so many cycles. `happens` adds what happens from outside meanwhile, given the cycle from which on; `answer` says what a
    /// responder without answers does after a question. The trace has what happened since the one before.
    ///
    /// # Errors
    /// When the emulator ends, or there is no such pin.
    pub fn advance(
        &mut self,
        cycles: u64,
        happens: impl FnOnce(&mut Run, u64),
        answer: impl FnMut(&Question) -> Vec<Drive>,
    ) -> Result<Trace, Error> {
        let mut run = Run::new("", self.now + cycles);
        happens(&mut run, self.now);
        run.check()?;
        let trace = self.node.run(&run, &[], answer)?;
        self.now = trace.cycles;
        Ok(trace)
    }
}
