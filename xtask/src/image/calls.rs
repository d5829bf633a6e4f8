//! Who calls whom, as the instructions of the linked image say, and how deep the stack gets.
//!
//! A call through a register may go to every function whose address is taken anywhere. That is more than can happen, so
//! what is not reachable here is not reachable at all.

use std::collections::BTreeSet;

use super::thumb::{Effect, decode};
use super::{Function, Image};
use crate::run::Result;

/// What one function does.
#[derive(Clone, Debug, Default)]
struct Node {
    calls: BTreeSet<usize>,
    /// Calls through a register.
    indirect: bool,
    /// Sum of everything it pushes: where paths through it push different amounts, this is more than any of them.
    frame_bytes: u32,
    /// Pushes an amount that only its registers know.
    unbounded: bool,
}

/// How names begin of the jumps that the linker adds where a call reaches too far for an ARMv6-M: from the flash to RAM.
const LONG_JUMP: &str = "__Thumbv6MABSLongThunk_";

/// The graph of calls.
pub struct Calls<'a> {
    image: &'a Image,
    nodes: Vec<Node>,
    taken: Vec<usize>,
}

/// Deepest stack below a function, and the way there.
#[derive(Clone, Debug)]
pub struct Depth {
    /// Bytes, its own frame included.
    pub bytes: u32,
    /// Functions on the way, outermost first.
    pub path: Vec<String>,
}

impl<'a> Calls<'a> {
    /// Reads every function of the image.
    pub fn from_image(image: &'a Image) -> Self {
        let nodes = (0..image.functions.len()).map(|index| node(image, index)).collect();
        let taken = image.taken.iter().filter_map(|address| image.function_at(*address)).collect();
        Self { image, nodes, taken }
    }

    /// The functions that one calls, or may call.
    fn callees(&self, index: usize) -> impl Iterator<Item = usize> {
        let node = &self.nodes[index];
        let somewhere = if node.indirect { self.taken.as_slice() } else { &[] };
        node.calls.iter().chain(somewhere).copied()
    }

    /// The shortest way from `root` to a function that `wanted` accepts, outermost first.
    pub fn path(&self, root: usize, wanted: impl Fn(&Function) -> bool) -> Option<Vec<String>> {
        let mut from = vec![None; self.nodes.len()];
        let mut queue = std::collections::VecDeque::from([root]);
        from[root] = Some(root);
        while let Some(index) = queue.pop_front() {
            if wanted(&self.image.functions[index]) {
                let mut path = vec![index];
                let mut at = index;
                while at != root {
                    at = from[at].expect("it was queued by a function that had been reached");
                    path.push(at);
                }
                return Some(path.into_iter().rev().map(|index| self.name(index)).collect());
            }
            for callee in self.callees(index) {
                if from[callee].is_none() {
                    from[callee] = Some(index);
                    queue.push_back(callee);
                }
            }
        }
        None
    }

    /// Functions that `root` can reach, itself included.
    pub fn reachable(&self, root: usize) -> BTreeSet<usize> {
        let mut seen = BTreeSet::from([root]);
        let mut rest = vec![root];
        while let Some(index) = rest.pop() {
            for callee in self.callees(index) {
                if seen.insert(callee) {
                    rest.push(callee);
                }
            }
        }
        seen
    }

    /// Functions below `root` that call through a register.
    pub fn indirect(&self, root: usize) -> Vec<String> {
        self.reachable(root)
            .into_iter()
            .filter(|index| self.nodes[*index].indirect)
            .map(|index| self.name(index))
            .collect()
    }

    /// Deepest stack below `root`. What `ends` accepts does not return and does not count.
    ///
    /// # Errors
    /// When a function may call itself, or takes an amount of stack that is not in its code.
    pub fn depth(&self, root: usize, ends: &dyn Fn(&Function) -> bool) -> Result<Depth> {
        let mut known = vec![None; self.nodes.len()];
        let bytes = self.depth_below(root, ends, &mut known, &mut vec![])?;
        let mut path = vec![self.name(root)];
        let mut at = root;
        while let Some((_, Some(next))) = known[at] {
            path.push(self.name(next));
            at = next;
        }
        Ok(Depth { bytes, path })
    }

    fn depth_below(
        &self,
        index: usize,
        ends: &dyn Fn(&Function) -> bool,
        known: &mut Vec<Option<(u32, Option<usize>)>>,
        above: &mut Vec<usize>,
    ) -> Result<u32> {
        if let Some((bytes, _)) = known[index] {
            return Ok(bytes);
        }
        if let Some(first) = above.iter().position(|other| *other == index) {
            let names: Vec<_> = above[first..].iter().map(|index| self.name(*index)).collect();
            return Err(format!("these call each other in a circle: {}", names.join(" -> ")));
        }
        let node = &self.nodes[index];
        if node.unbounded {
            return Err(format!("{} takes an amount of stack that is not in its code", self.name(index)));
        }
        above.push(index);
        let mut deepest = (0, None);
        for callee in self.callees(index).filter(|callee| !ends(&self.image.functions[*callee])) {
            let bytes = self.depth_below(callee, ends, known, above)?;
            if bytes > deepest.0 {
                deepest = (bytes, Some(callee));
            }
        }
        above.pop();
        let bytes = node.frame_bytes + deepest.0;
        known[index] = Some((bytes, deepest.1));
        Ok(bytes)
    }

    fn name(&self, index: usize) -> String {
        self.image.functions[index].name().to_owned()
    }
}

fn word(image: &Image, address: u32) -> Option<i32> {
    let (low, high) = (image.halfword(address)?, image.halfword(address + 2)?);
    Some((u32::from(high) << 16 | u32::from(low)).cast_signed())
}

fn node(image: &Image, index: usize) -> Node {
    let function = &image.functions[index];
    let mut node = Node::default();
    let end = function.address + function.size;
    if function.name().starts_with(LONG_JUMP) {
        // Its last word is where it goes; its instructions put that on the stack and return to it.
        node.calls.extend(word(image, end - 4).and_then(|to| image.function_at(to.cast_unsigned() & !1)));
    }
    let mut address = function.address;
    // What the low registers were loaded with last.
    let mut loaded = [None; 8];
    while address < end {
        if image.is_data(address) {
            address += 2;
            continue;
        }
        let Some(first) = image.halfword(address) else { break };
        let (length, effect) = decode(address, first, image.halfword(address + 2).unwrap_or(0));
        match effect {
            Effect::None => {}
            Effect::Goes(to) if (function.address..end).contains(&to) && to != function.address => {}
            Effect::Goes(to) => {
                // A branch back to the function's first instruction is a loop; a call of it is a recursion.
                let call = length == 4 && image.halfword(address + 2).is_some_and(|second| second & 0xD000 == 0xD000);
                if let Some(callee) = image.function_at(to)
                    && (callee != index || call)
                {
                    node.calls.insert(callee);
                }
            }
            Effect::GoesSomewhere => node.indirect = true,
            Effect::Pushes(bytes) => node.frame_bytes += bytes,
            Effect::PushesSomething => node.unbounded = true,
            Effect::Loads(register, from) => {
                if let Some(place) = loaded.get_mut(register as usize) {
                    *place = word(image, from);
                }
            }
            Effect::AddsToStack(register) => match loaded.get(register as usize).copied().flatten() {
                // What is added back was taken before.
                Some(bytes) => node.frame_bytes += bytes.min(0).unsigned_abs(),
                None => node.unbounded = true,
            },
        }
        address += length;
    }
    node
}
