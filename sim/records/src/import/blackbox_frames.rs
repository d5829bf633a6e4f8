//! The blackbox container (Betaflight, *Blackbox Internals*): headers of text that name the fields and say how each is
//! predicted and encoded, then frames. An `I` frame stands alone; a `P` frame holds differences to the two frames before.
//!
//! - One layout for all versions: what a log holds is read from its headers, never from the firmware's version.
//! - Frames carry no checksum. A frame counts when a next one, or the end, follows right behind it, and its time moves
//!   on plausibly. After damage all `P` frames are left out up to the next `I` frame.
//!
//! Why not a crate: `blackbox-log` 0.4.3 (MIT or Apache-2.0) reads this container too, but refuses the logs of all firmware other
//! than Betaflight 4.2 to 4.5 and INAV 5 and 6, and so those of the Betaflight releases since. After damage it goes on at any
//! frame, so that `P` frames may be added to frames from before the damage; it has no test of time, and tells neither how much was
//! lost nor where. All of that a measurement has to know.

use std::collections::HashMap;

use super::mat5::Damage;

/// The first line of every log.
const MARKER: &[u8] = b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n";
/// Fields of a frame; Betaflight has about 60. Keeps the work within a multiple of the file.
const MAX_FIELDS: usize = 256;
/// Bytes of a frame, as in Betaflight's own reader.
const MAX_FRAME: usize = 256;
/// Time between frames beyond which one of them is damaged, in microseconds, unless the log says that it paused.
const MAX_STEP_US: i64 = 10_000_000;
const KINDS: &[u8] = b"IPSGHE";

/// The logs of a file, each from its marker to the next.
pub(super) fn logs(bytes: &[u8]) -> Vec<&[u8]> {
    let is_start = |&at: &usize| bytes[at] == b'H' && bytes[at..].starts_with(MARKER);
    let starts: Vec<usize> = (0..bytes.len()).filter(is_start).collect();
    let ends = starts.iter().skip(1).copied().chain([bytes.len()]);
    starts.iter().zip(ends).map(|(&start, end)| &bytes[start..end]).collect()
}

/// The headers of one log, and where its frames are.
pub(super) struct BlackboxLog<'a> {
    headers: HashMap<&'a str, &'a str>,
    /// The fields of `I` and `P` frames.
    pub(super) names: Vec<&'a str>,
    intra: Vec<(Predictor, Encoding)>,
    inter: Vec<(Predictor, Encoding)>,
    slow: Vec<Encoding>,
    gps: Vec<Encoding>,
    home: Vec<Encoding>,
    time: usize,
    frames: &'a [u8],
    /// Where the frames begin in the log.
    start: usize,
}

/// What a field is a difference to.
#[derive(Clone, Copy)]
enum Predictor {
    /// Nothing, or a number of the headers.
    Constant(i32),
    Previous,
    StraightLine,
    Average,
    /// The field of this place in the same frame: the first motor.
    Field(usize),
    Increment,
}

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    /// Seven bits a byte, zigzag.
    Signed,
    /// Seven bits a byte.
    Unsigned,
    /// The same of 14 bits, negated.
    Negative14,
    /// A byte that says which of up to eight fields are there.
    Tag8,
    /// Three fields of one width.
    Tag2,
    /// Four fields of 0, 4, 8 or 16 bits.
    Tag4,
    /// Not written.
    Null,
}

impl Encoding {
    fn parse(code: &str) -> Option<Self> {
        Some(match code {
            "0" => Self::Signed,
            "1" => Self::Unsigned,
            "3" => Self::Negative14,
            "6" => Self::Tag8,
            "7" => Self::Tag2,
            "8" => Self::Tag4,
            "9" => Self::Null,
            _ => return None,
        })
    }

    /// Fields next to each other that are written together.
    fn group(self) -> usize {
        match self {
            Self::Tag8 => 8,
            Self::Tag2 => 3,
            Self::Tag4 => 4,
            _ => 1,
        }
    }
}

/// The rows of a log: times, and the fields that were wanted.
pub(super) struct Rows<const N: usize> {
    /// Microseconds, and the fields in the order in which they were wanted; 0 for one that is not there.
    pub(super) rows: Vec<(i64, [i32; N])>,
    /// Where frames are damaged: how often, and where first.
    pub(super) damaged: usize,
    pub(super) first_damage: usize,
    /// Frames that are whole but hang on a damaged one.
    pub(super) lost: usize,
    /// Pauses that the log itself tells.
    pub(super) pauses: usize,
    /// Whether the log was closed; otherwise it was cut.
    pub(super) closed: bool,
}

impl<'a> BlackboxLog<'a> {
    /// Reads the headers of a log that begins with the marker.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, Damage> {
        let mut headers = HashMap::new();
        let mut at = 0;
        while let Some(line) = bytes[at..].strip_prefix(b"H ") {
            let cut = Damage { offset: at, problem: "the log ends within its headers" };
            let end = line.iter().position(|&b| b == b'\n').ok_or(cut)?;
            let text = str::from_utf8(&line[..end]).ok().and_then(|text| text.split_once(':'));
            let (name, value) = text.ok_or(Damage { offset: at, problem: "a header that cannot be read" })?;
            headers.insert(name, value.trim_end());
            at += 2 + end + 1;
        }
        let damage = |problem| Damage { offset: at, problem };
        // A single byte may be the beginning of the next header.
        if bytes.len() - at < 2 {
            return Err(damage("the log ends within its headers"));
        }
        if headers.get("Data version") != Some(&"2") {
            return Err(damage("a version of the blackbox that is not known"));
        }
        let list = |name: &str| headers.get(name).map(|value| value.split(',').map(str::trim));
        let encodings = |name: &str| match list(name) {
            None => Some(Vec::new()),
            Some(codes) => codes.map(Encoding::parse).collect::<Option<Vec<_>>>(),
        };
        let unreadable = damage("the headers that define the fields cannot be read");
        let names: Vec<&str> = list("Field I name").ok_or(unreadable)?.collect();
        let first_motor = names.iter().position(|name| *name == "motor[0]");
        let time = names.iter().position(|name| *name == "time").ok_or(unreadable)?;
        let number = |name: &str| headers.get(name)?.split(',').next()?.trim().parse().ok();
        let predictor = |code: &str| {
            Some(match code {
                "0" => Predictor::Constant(0),
                "1" => Predictor::Previous,
                "2" => Predictor::StraightLine,
                "3" => Predictor::Average,
                "4" => Predictor::Constant(number("minthrottle")?),
                "5" => Predictor::Field(first_motor?),
                "6" => Predictor::Increment,
                "8" => Predictor::Constant(1500),
                "9" => Predictor::Constant(number("vbatref")?),
                "11" => Predictor::Constant(number("motorOutput")?),
                _ => return None,
            })
        };
        let fields = |frame: char| {
            let predictors = list(&format!("Field {frame} predictor"))?.map(predictor).collect::<Option<Vec<_>>>()?;
            let encodings = encodings(&format!("Field {frame} encoding"))?;
            let same = predictors.len() == names.len() && encodings.len() == names.len();
            same.then(|| predictors.into_iter().zip(encodings).collect::<Vec<_>>())
        };
        let intra = fields('I').ok_or(unreadable)?;
        let inter = fields('P').ok_or(unreadable)?;
        let alone =
            |(predictor, _): &(Predictor, Encoding)| matches!(predictor, Predictor::Constant(_) | Predictor::Field(_));
        if !intra.iter().all(alone) {
            return Err(unreadable);
        }
        let [slow, gps, home] = ["S", "G", "H"].map(|frame| encodings(&format!("Field {frame} encoding")));
        let [slow, gps, home] = [slow.ok_or(unreadable)?, gps.ok_or(unreadable)?, home.ok_or(unreadable)?];
        if [names.len(), slow.len(), gps.len(), home.len()].into_iter().any(|fields| fields > MAX_FIELDS) {
            return Err(damage("more fields in a frame than a blackbox has"));
        }
        Ok(Self { headers, names, intra, inter, slow, gps, home, time, frames: &bytes[at..], start: at })
    }

    /// The value of a header.
    pub(super) fn header(&self, name: &str) -> Option<&'a str> {
        self.headers.get(name).copied()
    }

    /// The frames.
    pub(super) fn frames(&self) -> &'a [u8] {
        self.frames
    }

    /// The place of a field.
    pub(super) fn field(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| *n == name)
    }

    /// The main frames, in their order of time.
    pub(super) fn rows<const N: usize>(&self, wanted: [Option<usize>; N]) -> Rows<N> {
        self.rows_and_show(wanted, |_, _| {})
    }

    /// The same, which shows each whole frame to `see`, and whether main frames may be differences to it: not one that hangs on damage.
    pub(super) fn rows_and_show<const N: usize>(
        &self,
        wanted: [Option<usize>; N],
        mut see: impl FnMut(&'a [u8], bool),
    ) -> Rows<N> {
        let mut rows = Rows { rows: Vec::new(), damaged: 0, first_damage: 0, lost: 0, pauses: 0, closed: false };
        let mut history = History::default();
        let mut at = 0;
        while at < self.frames.len() {
            let mut reader = Reader { bytes: self.frames, at: at + 1, ended: false };
            let frame = self.frame(self.frames[at], &mut reader, &mut history);
            if frame == Some(Frame::End) {
                rows.closed = true;
                break;
            }
            if reader.ended {
                break;
            }
            let followed = self.frames.get(reader.at).is_none_or(|next| KINDS.contains(next));
            let Some(frame) = frame.filter(|_| followed && reader.at - at <= MAX_FRAME) else {
                let next = self.frames[at + 1..].iter().position(|b| KINDS.contains(b));
                // Nothing but the filling of the storage behind a log that was cut.
                let Some(next) = next else { break };
                if history.valid || rows.damaged == 0 {
                    rows.first_damage = if rows.damaged == 0 { self.start + at } else { rows.first_damage };
                    rows.damaged += 1;
                }
                history.valid = false;
                at += 1 + next;
                continue;
            };
            let whole = &self.frames[at..reader.at];
            at = reader.at;
            match frame {
                Frame::Main { intra } => {
                    let accepted = history.accept(intra, self.time);
                    see(whole, intra || accepted.is_some());
                    let Some(time_us) = accepted else {
                        rows.lost += 1;
                        continue;
                    };
                    // A stream that took up anew further back: what is ahead of it was damage that looked whole.
                    while rows.rows.pop_if(|row| row.0 >= time_us).is_some() {
                        rows.lost += 1;
                    }
                    rows.rows.push((time_us, wanted.map(|field| field.map_or(0, |field| history.previous[field]))));
                }
                Frame::Resume { time } => {
                    see(whole, true);
                    rows.pauses += 1;
                    history.resume(time);
                }
                Frame::Other | Frame::End => see(whole, true),
            }
        }
        rows
    }

    /// One frame behind its first byte; a main one is left in `history.current`. `None`: damaged.
    fn frame(&self, kind: u8, reader: &mut Reader<'_>, history: &mut History) -> Option<Frame> {
        let skipped = match kind {
            b'I' | b'P' => {
                let intra = kind == b'I';
                let fields = if intra { &self.intra } else { &self.inter };
                reader.values(fields.iter().map(|f| f.1), &mut history.current)?;
                history.predict(fields);
                return Some(Frame::Main { intra });
            }
            b'S' => &self.slow,
            b'G' => &self.gps,
            b'H' => &self.home,
            _ => return reader.event(),
        };
        if skipped.is_empty() {
            return None;
        }
        reader.values(skipped.iter().copied(), &mut history.scratch)?;
        Some(Frame::Other)
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Frame {
    Main { intra: bool },
    Resume { time: i32 },
    Other,
    End,
}

/// The frames that `P` frames are differences to.
#[derive(Default)]
struct History {
    current: Vec<i32>,
    previous: Vec<i32>,
    before: Vec<i32>,
    scratch: Vec<i32>,
    /// Whether `previous` and `before` are the two frames before.
    valid: bool,
    /// Time of the last frame that was accepted; its lower 32 bits are the log's.
    last_us: Option<i64>,
    /// Time of an `I` frame that was refused: the next confirms it or not.
    refused_us: Option<i64>,
}

impl History {
    /// Adds to `current` what each field is a difference to. The numbers are those of 32 bits that wrap.
    fn predict(&mut self, fields: &[(Predictor, Encoding)]) {
        let past = |values: &[i32], k: usize| values.get(k).copied().unwrap_or(0);
        for (k, (predictor, _)) in fields.iter().enumerate() {
            let (one, two) = (past(&self.previous, k), past(&self.before, k));
            let predicted = match *predictor {
                Predictor::Constant(value) => value,
                Predictor::Previous => one,
                Predictor::StraightLine => one.wrapping_mul(2).wrapping_sub(two),
                Predictor::Average => ((i64::from(one) + i64::from(two)) / 2) as i32,
                Predictor::Field(field) => self.current[field],
                Predictor::Increment => one.wrapping_add(1),
            };
            self.current[k] = self.current[k].wrapping_add(predicted);
        }
    }

    /// Takes `current` as the newest frame and gives its time; `None` where it hangs on damage or its time is not
    /// plausible.
    fn accept(&mut self, intra: bool, time: usize) -> Option<i64> {
        if !(self.valid || intra) {
            return None;
        }
        let time = self.current[time];
        let follows = |last: &i64| (1..=MAX_STEP_US).contains(&(unwrapped(time, *last) - last));
        let refused = self.refused_us.take();
        let base = match self.last_us {
            None => Some(i64::from(time.cast_unsigned())),
            Some(last) if follows(&last) => Some(last),
            Some(_) => refused.filter(|us| intra && follows(us)),
        };
        self.valid = base.is_some();
        let Some(base) = base else {
            self.refused_us = self.last_us.filter(|_| intra).map(|last| unwrapped(time, last));
            return None;
        };
        let time_us = unwrapped(time, base);
        self.last_us = Some(time_us);
        if intra {
            self.previous.clone_from(&self.current);
            self.before.clone_from(&self.current);
        } else {
            std::mem::swap(&mut self.before, &mut self.previous);
            self.previous.clone_from(&self.current);
        }
        Some(time_us)
    }

    /// The log paused, and goes on at this time with an `I` frame.
    fn resume(&mut self, time: i32) {
        self.last_us = self.last_us.map(|last| last.max(unwrapped(time, last) - 1));
    }
}

/// The time near `last` whose lower 32 bits are `time`: the log's counter turns over every 71 minutes.
fn unwrapped(time: i32, last: i64) -> i64 {
    last + i64::from(time.wrapping_sub(last as i32))
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Whether more was asked for than there is.
    ended: bool,
}

impl Reader<'_> {
    fn byte(&mut self) -> Option<u8> {
        let byte = self.bytes.get(self.at).copied();
        self.ended |= byte.is_none();
        self.at += usize::from(byte.is_some());
        byte
    }

    fn unsigned(&mut self) -> Option<u32> {
        let mut value = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn signed(&mut self) -> Option<i32> {
        let value = self.unsigned()?;
        Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    /// `count` bytes, the lowest first, with their sign.
    fn little_endian(&mut self, count: u32) -> Option<i32> {
        let mut value = 0;
        for k in 0..count {
            value |= u32::from(self.byte()?) << (8 * k);
        }
        Some(extended(value, 8 * count))
    }

    /// The numbers of a frame's fields, before any prediction.
    fn values(&mut self, encodings: impl Iterator<Item = Encoding>, values: &mut Vec<i32>) -> Option<()> {
        values.clear();
        let mut encodings = encodings.peekable();
        while let Some(encoding) = encodings.next() {
            let mut count = 1;
            while count < encoding.group() && encodings.next_if_eq(&encoding).is_some() {
                count += 1;
            }
            match encoding {
                Encoding::Signed => values.push(self.signed()?),
                Encoding::Unsigned => values.push(self.unsigned()?.cast_signed()),
                Encoding::Negative14 => values.push(-extended(self.unsigned()?, 14)),
                Encoding::Null => values.push(0),
                Encoding::Tag8 => self.tag8(count, values)?,
                Encoding::Tag2 => values.extend_from_slice(&self.tag2()?[..count]),
                Encoding::Tag4 => values.extend_from_slice(&self.tag4()?[..count]),
            }
        }
        Some(())
    }

    /// A field alone has no tag.
    fn tag8(&mut self, count: usize, values: &mut Vec<i32>) -> Option<()> {
        let tag = if count == 1 { 1 } else { self.byte()? };
        for k in 0..count {
            values.push(if tag >> k & 1 == 1 { self.signed()? } else { 0 });
        }
        Some(())
    }

    fn tag2(&mut self) -> Option<[i32; 3]> {
        let tag = self.byte()?;
        let bits = |byte: u8, width: u32| extended(u32::from(byte), width);
        Some(match tag >> 6 {
            0 => [bits(tag >> 4, 2), bits(tag >> 2, 2), bits(tag, 2)],
            1 => {
                let next = self.byte()?;
                [bits(tag, 4), bits(next >> 4, 4), bits(next, 4)]
            }
            2 => [bits(tag, 6), bits(self.byte()?, 6), bits(self.byte()?, 6)],
            _ => {
                let mut width = |k: u32| self.little_endian(u32::from(tag >> (2 * k) & 3) + 1);
                [width(0)?, width(1)?, width(2)?]
            }
        })
    }

    /// Half bytes, the upper one first; those of a wide field may begin within a byte.
    fn tag4(&mut self) -> Option<[i32; 4]> {
        let tag = self.byte()?;
        let mut half: Option<u8> = None;
        let mut nibble = |reader: &mut Self| match half.take() {
            Some(low) => Some(low),
            None => {
                let byte = reader.byte()?;
                half = Some(byte & 0xf);
                Some(byte >> 4)
            }
        };
        let mut values = [0; 4];
        for (k, value) in values.iter_mut().enumerate() {
            let nibbles = [0, 1, 2, 4][usize::from(tag >> (2 * k) & 3)];
            let mut bits = 0;
            for _ in 0..nibbles {
                bits = bits << 4 | u32::from(nibble(self)?);
            }
            *value = if nibbles == 0 { 0 } else { extended(bits, 4 * nibbles) };
        }
        Some(values)
    }

    fn event(&mut self) -> Option<Frame> {
        match self.byte()? {
            // A beep to synchronize, a reason for disarming, a failure of the gyroscope.
            0 | 15 | 40 => self.unsigned().map(|_| Frame::Other),
            // An adjustment in flight: a float or an integer.
            13 if self.byte()? & 0x80 != 0 => self.little_endian(4).map(|_| Frame::Other),
            13 => self.signed().map(|_| Frame::Other),
            14 => {
                self.unsigned()?;
                self.unsigned().map(|time| Frame::Resume { time: time.cast_signed() })
            }
            // A change of the flight mode.
            30 => self.unsigned().and_then(|_| self.unsigned()).map(|_| Frame::Other),
            255 => self.bytes[self.at..].starts_with(b"End of log").then_some(Frame::End),
            _ => None,
        }
    }
}

/// The lowest `width` bits with their sign, 1 to 32 of them.
fn extended(value: u32, width: u32) -> i32 {
    let spare = 32 - width;
    (value << spare).cast_signed() >> spare
}
