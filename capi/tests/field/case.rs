//! Reads a case. `docs/field-cases.md` describes the notation.

use crate::wire::Block;
use mbm_c::*;
use std::path::Path;

/// One report from the field.
pub struct Case {
    pub name: String,
    /// Where the symptom was reported: `owner/name#12`, or `mbm` for a trial of our own.
    pub report: String,
    pub symptom: String,
    /// What mbm does.
    pub mbm: String,
    pub roles: Vec<Role>,
    pub framing: Framing,
    pub baud: u32,
    /// Each of them is a test of its own.
    pub blocks: Vec<Block>,
    /// Why the case may fail. It must fail then.
    pub pending: Option<String>,
    pub settings: Vec<(String, u32)>,
    pub steps: Vec<(usize, Step)>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Role {
    Node,
    Client,
    Gateway,
    Server,
    Sniffer,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Framing {
    Rtu,
    Ascii,
    Tcp,
    RtuOverTcp,
}

impl Framing {
    pub fn is_stream(self) -> bool {
        matches!(self, Framing::Tcp | Framing::RtuOverTcp)
    }
}

/// Times are microseconds.
pub enum Step {
    Request(Call),
    /// Repeats the request until it succeeds, which it must do within this time.
    Within(u64, Call),
    Times(u32, Vec<(usize, Step)>),
    /// Starts all requests at once.
    Together(Vec<(usize, Step)>),
    Wait(u64),
    /// A device of this unit, or of every one; words set how it behaves.
    Device(Option<u8>, Vec<String>),
    /// What becomes of the next replies of a device.
    Fate(u8, Fate, u32),
    Answer(Vec<Token>),
    Hear(Vec<Token>),
    Reply(Vec<Token>),
    Silence(u64),
    /// The registers that the server serves from an address on.
    Registers(u16, Vec<u16>),
    Event(String, Vec<u8>),
    /// The number of frames that were sent since the last such step.
    Sent(Bound),
    /// The number of connections that were opened since the last such step.
    Opened(Bound),
    Echo(usize),
    Twin(u64),
}

#[derive(Clone, Copy)]
pub struct Bound {
    pub is_most: bool,
    pub count: usize,
}

impl Bound {
    pub fn holds(self, count: usize) -> bool {
        match self.is_most {
            true => count <= self.count,
            false => count == self.count,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fate {
    /// The reply does not come.
    Lost,
    /// The device does not receive the request.
    Unheard,
    /// The reply comes this long after the request.
    Late(u64),
    Exception(u8),
    /// One bit is wrong.
    Damaged,
    /// The first bytes only.
    Cut(usize),
    Twice,
}

/// A request of the program, and how it shall end.
#[derive(Clone)]
pub struct Call {
    pub request: Request,
    /// The program gives it up after this time.
    pub limit: Option<u64>,
    pub want: Want,
    /// The request must have ended by then.
    pub most: Option<u64>,
}

#[derive(Clone)]
pub struct Request {
    pub unit: u8,
    pub function: u8,
    pub address: u16,
    /// The address is counted up by each round of the loop.
    pub counts: bool,
    pub quantity: u16,
    pub words: Vec<u16>,
    pub bytes: Vec<u8>,
    pub rule: (u8, u8),
    pub kind: RequestKind,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RequestKind {
    Standard,
    Custom,
    Forward,
}

impl Request {
    pub fn is_read(&self) -> bool {
        self.kind == RequestKind::Standard && (1..=4).contains(&self.function)
    }

    /// The address in this round of the loop.
    pub fn at(&self, round: u32) -> Request {
        let mut request = self.clone();
        if self.counts {
            request.address = self.address.wrapping_add(round as u16);
        }
        request
    }

    /// The PDU. Coils are all 0.
    pub fn pdu(&self) -> Vec<u8> {
        let mut pdu = vec![self.function];
        if self.kind != RequestKind::Standard {
            pdu.extend(&self.bytes);
            return pdu;
        }
        pdu.extend(self.address.to_be_bytes());
        match self.function {
            5 if self.words[0] != 0 => pdu.extend([0xFF, 0]),
            5 => pdu.extend([0, 0]),
            6 => pdu.extend(self.words[0].to_be_bytes()),
            0x10 => {
                pdu.extend(self.quantity.to_be_bytes());
                pdu.push(2 * self.quantity as u8);
                pdu.extend(self.words.iter().flat_map(|word| word.to_be_bytes()));
            }
            _ => pdu.extend(self.quantity.to_be_bytes()),
        }
        pdu
    }
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Want {
    /// Anything but wrong data.
    Any,
    Ok,
    /// These bytes were received.
    Data(Vec<u8>),
    Status(u8),
    /// Any status but MBM_OK.
    Failed,
}

/// A part of the bytes on the wire.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Token {
    Byte(u8),
    /// The CRC or LRC, or the MBAP header, of the frame that ends here.
    Seal,
    /// Another frame begins.
    Next,
    /// The device sends nothing for this time.
    Pause(u64),
    /// The transaction number of the request.
    Transaction,
}

type Read<T> = Result<T, String>;

/// Milliseconds with decimals, in microseconds.
fn time(text: &str) -> Read<u64> {
    let time: f64 = text
        .parse()
        .map_err(|_| format!("not a time in ms: {text}"))?;
    Ok((time * 1_000.0) as u64)
}

fn number<T: std::str::FromStr>(text: &str) -> Read<T> {
    text.parse()
        .map_err(|_| format!("not a number that fits: {text}"))
}

fn byte(text: &str) -> Read<u8> {
    match text.len() {
        2 => u8::from_str_radix(text, 16).map_err(|_| format!("not a byte: {text}")),
        _ => Err(format!("not a byte of two hexadecimal digits: {text}")),
    }
}

fn token(text: &str, tokens: &mut Vec<Token>) -> Read<()> {
    if let Some((value, times)) = text.split_once('*') {
        let (value, times) = (byte(value)?, number::<usize>(times)?);
        tokens.extend(vec![Token::Byte(value); times]);
        return Ok(());
    }
    tokens.push(match text {
        "+" => Token::Seal,
        "/" => Token::Next,
        "T" => Token::Transaction,
        _ if text.starts_with('~') => Token::Pause(time(&text[1..])?),
        _ => Token::Byte(byte(text)?),
    });
    Ok(())
}

fn tokens(words: &[&str]) -> Read<Vec<Token>> {
    let mut tokens = Vec::new();
    for word in words {
        token(word, &mut tokens)?;
    }
    Ok(tokens)
}

fn want(words: &[&str]) -> Read<Want> {
    let [name, rest @ ..] = words else {
        return Err("what is expected is missing".into());
    };
    let mut data = Vec::new();
    for word in rest {
        // A register has four digits, a byte two.
        for pair in word.as_bytes().chunks(2) {
            data.push(byte(std::str::from_utf8(pair).map_err(|_| "not ASCII")?)?);
        }
    }
    Ok(match (*name, data.as_slice()) {
        ("ok", []) => Want::Ok,
        ("ok", _) => Want::Data(data),
        ("exception", [code]) => Want::Status(*code),
        ("any", []) => Want::Any,
        ("failed", []) => Want::Failed,
        ("timeout", []) => Want::Status(MBM_RESPONSE_TIMED_OUT),
        ("crc", []) => Want::Status(MBM_INVALID_CRC),
        ("malformed", []) => Want::Status(MBM_MALFORMED_REPLY),
        ("other-unit", []) => Want::Status(MBM_INVALID_SLAVE_ID),
        ("other-function", []) => Want::Status(MBM_INVALID_FUNCTION),
        ("cancelled", []) => Want::Status(MBM_CANCELLED),
        ("lost", []) => Want::Status(MBM_LINK_LOST),
        _ => return Err(format!("not an outcome: {}", words.join(" "))),
    })
}

/// Reads `VERB ... [limit MS] [= OUTCOME] [in MS]`; `None` if the verb makes no request.
fn call(words: &[&str]) -> Read<Option<Call>> {
    let (verb, mut words) = (words[0], words[1..].to_vec());
    let mut call = Call {
        request: Request {
            unit: 0,
            function: 0,
            address: 0,
            counts: false,
            quantity: 1,
            words: Vec::new(),
            bytes: Vec::new(),
            rule: (MBM_RULE_SILENCE, 0),
            kind: RequestKind::Standard,
        },
        limit: None,
        want: Want::Any,
        most: None,
    };
    let request = &mut call.request;
    (request.function, request.kind) = match verb {
        "read-coils" => (1, RequestKind::Standard),
        "read-discrete" => (2, RequestKind::Standard),
        "read" => (3, RequestKind::Standard),
        "read-inputs" => (4, RequestKind::Standard),
        "write-coil" => (5, RequestKind::Standard),
        "write" => (6, RequestKind::Standard),
        "write-many" => (0x10, RequestKind::Standard),
        "custom" => (0, RequestKind::Custom),
        "forward" => (0, RequestKind::Forward),
        _ => return Ok(None),
    };
    if let Some(at) = words.iter().position(|word| *word == "in") {
        call.most = Some(time(
            words.get(at + 1).ok_or("a time is missing after in")?,
        )?);
        words.truncate(at);
    }
    if let Some(at) = words.iter().position(|word| *word == "=") {
        call.want = want(&words[at + 1..])?;
        words.truncate(at);
    }
    if let Some(at) = words.iter().position(|word| *word == "limit") {
        call.limit = Some(time(
            words.get(at + 1).ok_or("a time is missing after limit")?,
        )?);
        words.truncate(at);
    }
    let [unit, place, rest @ ..] = words.as_slice() else {
        return Err(format!("{verb} needs a unit and more"));
    };
    request.unit = number(unit)?;
    if request.kind != RequestKind::Standard {
        request.function = byte(place)?;
        let mut rest = rest;
        match rest {
            ["fixed", bytes, more @ ..] => {
                request.rule = (MBM_RULE_FIXED, number(bytes)?);
                rest = more;
            }
            ["counted", bytes, more @ ..] => {
                request.rule = (MBM_RULE_COUNTED, number(bytes)?);
                rest = more;
            }
            _ => {}
        }
        for word in rest {
            request.bytes.push(byte(word)?);
        }
        return Ok(Some(call));
    }
    request.counts = *place == "n";
    request.address = if request.counts { 0 } else { number(place)? };
    match (request.function, rest) {
        (1..=4, [quantity]) => request.quantity = number(quantity)?,
        (5 | 6, [value]) => request.words = vec![number(value)?],
        (0x10, [_, ..]) => {
            for word in rest {
                let (value, times) = word.split_once('*').unwrap_or((word, "1"));
                let (value, times) = (number::<u16>(value)?, number::<usize>(times)?);
                request.words.extend(vec![value; times]);
            }
            request.quantity = request.words.len() as u16;
        }
        _ => return Err(format!("{verb} has other arguments")),
    }
    Ok(Some(call))
}

fn bound(words: &[&str]) -> Read<Bound> {
    match words {
        ["<=", count] => Ok(Bound {
            is_most: true,
            count: number(count)?,
        }),
        ["=", count] => Ok(Bound {
            is_most: false,
            count: number(count)?,
        }),
        _ => Err("needs = or <= and a number".into()),
    }
}

fn step(words: &[&str]) -> Read<Step> {
    if let Some(call) = call(words)? {
        return Ok(Step::Request(call));
    }
    let fate = |unit: &str, fate, count: &[&str]| -> Read<Step> {
        let count = count.first().map_or(Ok(1), |count| number(count))?;
        Ok(Step::Fate(number(unit)?, fate, count))
    };
    Ok(match words {
        ["within", most, rest @ ..] if !rest.is_empty() => {
            let call = call(rest)?.ok_or("a request is missing")?;
            Step::Within(time(most)?, call)
        }
        ["wait", most] => Step::Wait(time(most)?),
        ["device", unit, rest @ ..] => {
            let unit = match *unit {
                "any" => None,
                unit => Some(number(unit)?),
            };
            Step::Device(unit, rest.iter().map(|word| word.to_string()).collect())
        }
        ["lose", unit, count @ ..] => fate(unit, Fate::Lost, count)?,
        ["unheard", unit, count @ ..] => fate(unit, Fate::Unheard, count)?,
        ["late", unit, after, count @ ..] => fate(unit, Fate::Late(time(after)?), count)?,
        ["except", unit, code, count @ ..] => fate(unit, Fate::Exception(byte(code)?), count)?,
        ["damage", unit, count @ ..] => fate(unit, Fate::Damaged, count)?,
        ["cut", unit, bytes, count @ ..] => fate(unit, Fate::Cut(number(bytes)?), count)?,
        ["twice", unit, count @ ..] => fate(unit, Fate::Twice, count)?,
        ["answer", rest @ ..] => Step::Answer(tokens(rest)?),
        ["hear", rest @ ..] => Step::Hear(tokens(rest)?),
        ["reply", rest @ ..] => Step::Reply(tokens(rest)?),
        ["silence", most] => Step::Silence(time(most)?),
        ["registers", address, "=", rest @ ..] => {
            let words = rest.iter().map(|word| number(word));
            Step::Registers(number(address)?, words.collect::<Read<_>>()?)
        }
        ["event", kind, rest @ ..] => {
            let numbers = rest.iter().map(|word| number(word));
            Step::Event(kind.to_string(), numbers.collect::<Read<_>>()?)
        }
        ["sent", rest @ ..] => Step::Sent(bound(rest)?),
        ["opened", rest @ ..] => Step::Opened(bound(rest)?),
        ["echo"] => Step::Echo(0),
        ["echo", lost] => Step::Echo(number(lost)?),
        ["twin", slow] => Step::Twin(time(slow)?),
        _ => return Err(format!("not a step: {}", words.join(" "))),
    })
}

/// Reads the lines up to `end`, or to the end of the case.
fn steps<'a>(
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
    is_inner: bool,
) -> Result<Vec<(usize, Step)>, (usize, String)> {
    let mut list = Vec::new();
    let mut last = 0;
    while let Some((line, text)) = lines.next() {
        last = line;
        let words: Vec<_> = text.split_whitespace().collect();
        let step = match words.as_slice() {
            ["end"] if is_inner => return Ok(list),
            ["times", count] => {
                let count = number(count).map_err(|why| (line, why))?;
                Step::Times(count, steps(lines, true)?)
            }
            ["together"] => Step::Together(steps(lines, true)?),
            _ => step(&words).map_err(|why| (line, why))?,
        };
        list.push((line, step));
    }
    match is_inner {
        true => Err((last, "end is missing".into())),
        false => Ok(list),
    }
}

fn role(name: &str) -> Read<Role> {
    Ok(match name {
        "node" => Role::Node,
        "client" => Role::Client,
        "gateway" => Role::Gateway,
        "server" => Role::Server,
        "sniffer" => Role::Sniffer,
        _ => return Err(format!("not a role: {name}")),
    })
}

fn framing(name: &str) -> Read<Framing> {
    Ok(match name {
        "rtu" => Framing::Rtu,
        "ascii" => Framing::Ascii,
        "tcp" => Framing::Tcp,
        "rtu-over-tcp" => Framing::RtuOverTcp,
        _ => return Err(format!("not a framing: {name}")),
    })
}

fn block(text: &str) -> Read<Block> {
    let (bytes, delay) = text.split_once('/').ok_or("a block is BYTES/MS")?;
    let bytes: usize = number(bytes)?;
    Ok(Block {
        bytes: bytes.max(1),
        delay: time(delay)?,
    })
}

/// The first line of a case, its head, and the lines of its steps.
type Part<'a> = (usize, Case, Vec<(usize, &'a str)>);

impl Case {
    fn new(name: &str) -> Case {
        Case {
            name: name.into(),
            report: String::new(),
            symptom: String::new(),
            mbm: String::new(),
            roles: Vec::new(),
            framing: Framing::Rtu,
            baud: 19_200,
            blocks: vec![Block { bytes: 1, delay: 0 }],
            pending: None,
            settings: Vec::new(),
            steps: Vec::new(),
        }
    }

    fn head(&mut self, text: &str) -> Read<bool> {
        let (key, value) = text.split_once(' ').unwrap_or((text, ""));
        let value = value.trim();
        match key {
            "report" => self.report = value.into(),
            "symptom" => self.symptom = value.into(),
            "mbm" => self.mbm = value.into(),
            "role" => {
                let roles = value.split_whitespace().map(role);
                self.roles = roles.collect::<Read<_>>()?;
            }
            "framing" => self.framing = framing(value)?,
            "baud" => self.baud = number(value)?,
            "blocks" => {
                let blocks = value.split_whitespace().map(block);
                self.blocks = blocks.collect::<Read<_>>()?;
            }
            "pending" => self.pending = Some(value.into()),
            "set" => {
                let (key, value) = value.split_once(' ').ok_or("a setting needs a value")?;
                self.settings.push((key.into(), number(value)?));
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Reads the cases of a file. Each begins with `case NAME`.
    pub fn read(path: &Path) -> Result<Vec<Case>, String> {
        let at = |line: usize, why: String| format!("{}:{line}: {why}", path.display());
        let text = std::fs::read_to_string(path).map_err(|why| at(0, why.to_string()))?;
        let mut parts: Vec<Part> = Vec::new();
        for (index, text) in text.lines().enumerate() {
            let (line, text) = (index + 1, text.trim());
            if text.is_empty() || text.starts_with('#') {
                continue;
            }
            if let Some(name) = text.strip_prefix("case ") {
                parts.push((line, Case::new(name), Vec::new()));
                continue;
            }
            let (_, case, body) = parts
                .last_mut()
                .ok_or_else(|| at(line, "case is missing".into()))?;
            if !body.is_empty() || !case.head(text).map_err(|why| at(line, why))? {
                body.push((line, text));
            }
        }
        let finish = |(line, mut case, body): Part| {
            case.steps =
                steps(&mut body.into_iter(), false).map_err(|(line, why)| at(line, why))?;
            let missing = [
                (case.report.is_empty(), "report"),
                (case.symptom.is_empty(), "symptom"),
                (case.mbm.is_empty(), "mbm"),
                (case.roles.is_empty(), "role"),
                (case.steps.is_empty(), "a step"),
            ];
            match missing.iter().find(|(is_missing, _)| *is_missing) {
                Some((_, what)) => Err(at(line, format!("{what} is missing"))),
                None => Ok(case),
            }
        };
        parts.into_iter().map(finish).collect()
    }
}
