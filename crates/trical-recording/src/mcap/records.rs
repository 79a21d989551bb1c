//! Reads the records of an MCAP file, whole, cut or damaged, without ever panicking.
//!
//! The readers of the `mcap` crate (0.26) overflow or index out of bounds on damaged files, so the few record types that
//! matter here are taken apart by hand.

use std::collections::{BTreeMap, HashMap};
use std::io::Read;

use ruzstd::decoding::StreamingDecoder;

use super::Attachment;

/// A message as it stands in the file.
pub(super) struct RawMessage {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    pub(super) log_time: u64,
    pub(super) publish_time: u64,
    pub(super) data: Vec<u8>,
}

/// A channel as it stands in the file.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct RawChannel {
    pub(super) topic: String,
    pub(super) encoding: String,
    pub(super) metadata: BTreeMap<String, String>,
    pub(super) schema: Option<RawSchema>,
}

/// A schema as it stands in the file.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct RawSchema {
    pub(super) name: String,
    pub(super) encoding: String,
    pub(super) data: Vec<u8>,
}

/// Channels by their numbers.
pub(super) type Channels = BTreeMap<u16, RawChannel>;

/// All that is whole in a file.
#[derive(Default)]
pub(super) struct RawFile {
    pub(super) channels: Channels,
    pub(super) messages: Vec<RawMessage>,
    pub(super) attachments: Vec<Attachment>,
    pub(super) metadata: Vec<(String, BTreeMap<String, String>)>,
    /// What was lost, one phrase each.
    pub(super) losses: Vec<String>,
    schemas: HashMap<u16, RawSchema>,
    only_read: bool,
    ended: bool,
}

pub(super) const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];

const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const ATTACHMENT: u8 = 0x09;
const METADATA: u8 = 0x0C;
const DATA_END: u8 = 0x0F;

/// A chunk is never unpacked to more than this; writers cut them at 1 to 4 MiB.
const LARGEST_CHUNK: u64 = 1 << 27;

/// Takes all whole records out of the bytes that follow the magic; where `only_read`, without the messages that nobody here makes sense of:
/// pictures, say, in a bag of others.
///
/// # Errors
/// A compression that is not known.
pub(super) fn read_records(body: &[u8], only_read: bool) -> Result<RawFile, String> {
    let mut file = RawFile { only_read, ..RawFile::default() };
    let mut at = MAGIC.len();
    let mut rest = body;
    while !rest.is_empty() && !file.ended {
        let Some((opcode, content, after)) = split_record(rest) else {
            let chunk = rest
                .strip_prefix(&[CHUNK])
                .and_then(|rest| rest.get(8..))
                .and_then(|content| Some((content, ChunkHead::parse(content)?)));
            if let Some((content, chunk)) = chunk {
                if let Some(after) = chunk.after() {
                    // only the length of the record was wrong: the chunk knows its own
                    file.losses.push(format!("the record at byte {at} has a wrong length"));
                    file.chunk(content, at)?;
                    at += rest.len() - after.len();
                    rest = after;
                    continue;
                }
                // the last chunk of a file that was cut still holds whole messages
                if chunk.compression.is_empty() {
                    file.inner_records(chunk.data);
                }
            }
            file.losses.push(format!("it ends in the middle of a record at byte {at}"));
            break;
        };
        match opcode {
            CHUNK => file.chunk(content, at)?,
            // the summary repeats schemas and channels
            DATA_END => {}
            FOOTER => file.ended = true,
            _ => {
                if file.record(opcode, content).is_none() {
                    file.losses.push(format!("the record at byte {at} is damaged"));
                }
            }
        }
        at += rest.len() - after.len();
        rest = after;
    }
    if !file.ended && file.losses.is_empty() {
        file.losses.push("it has no end record".to_owned());
    }
    let known = &file.channels;
    let all = file.messages.len();
    file.messages.retain(|message| known.contains_key(&message.channel));
    if file.messages.len() < all {
        file.losses.push(format!("{} messages belong to no known channel", all - file.messages.len()));
    }
    Ok(file)
}

/// As [`read_records`], of a file that is read piece by piece, and hands out messages as they come instead of keeping them. Attachments are
/// passed over. A file that is not whole is refused.
///
/// # Errors
/// What `each` returns, what the operating system says, and what is wrong with the file, each with the way to say it.
pub(super) fn read_in_pieces<E>(
    reader: &mut dyn Read,
    each: &mut dyn FnMut(&Channels, RawMessage) -> Result<(), E>,
    unreadable: &dyn Fn(String) -> E,
    io: &dyn Fn(std::io::Error) -> E,
) -> Result<(), E> {
    let mut file = RawFile::default();
    let mut at = MAGIC.len() as u64;
    let mut content = Vec::new();
    while !file.ended {
        let mut head = [0; 9];
        reader.read_exact(&mut head).map_err(|e| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                unreadable(format!("is cut: it ends at byte {at} without an end record"))
            }
            _ => io(e),
        })?;
        let (opcode, mut length) = (head[0], [0; 8]);
        length.copy_from_slice(&head[1..]);
        let length = u64::from_le_bytes(length);
        content.clear();
        if opcode == ATTACHMENT {
            let passed = std::io::copy(&mut reader.take(length), &mut std::io::sink()).map_err(io)?;
            if passed < length {
                return Err(unreadable(format!("is cut: it ends in the middle of a record at byte {at}")));
            }
        } else {
            if length > LARGEST_CHUNK {
                return Err(unreadable(format!(
                    "the record at byte {at} says that it is {length} bytes long; expected at most {LARGEST_CHUNK}"
                )));
            }
            reader.take(length).read_to_end(&mut content).map_err(io)?;
            if (content.len() as u64) < length {
                return Err(unreadable(format!("is cut: it ends in the middle of a record at byte {at}")));
            }
            match opcode {
                CHUNK => file.chunk(&content, usize::try_from(at).unwrap_or(usize::MAX)).map_err(unreadable)?,
                DATA_END => {}
                FOOTER => file.ended = true,
                _ if file.record(opcode, &content).is_none() => {
                    file.losses.push(format!("the record at byte {at} is damaged"));
                }
                _ => {}
            }
        }
        if let Some(loss) = file.losses.first() {
            return Err(unreadable(format!("the recording is damaged or incomplete ({loss})")));
        }
        for message in file.messages.drain(..) {
            each(&file.channels, message)?;
        }
        at += 9 + length;
    }
    Ok(())
}

impl RawFile {
    fn chunk(&mut self, content: &[u8], at: usize) -> Result<(), String> {
        let Some(chunk) = ChunkHead::parse(content) else {
            self.losses.push(format!("the chunk at byte {at} is damaged"));
            return Ok(());
        };
        let whole = chunk.whole();
        let unpacked = match (chunk.compression, whole) {
            ("", Some(data)) => Some(data.to_vec()),
            ("lz4", Some(data)) => {
                lz4::Decoder::new(data).ok().and_then(|from| unpacked(from, chunk.uncompressed_size))
            }
            ("zstd", Some(data)) => {
                StreamingDecoder::new(data).ok().and_then(|from| unpacked(from, chunk.uncompressed_size))
            }
            ("" | "lz4" | "zstd", None) => None,
            (other, _) => {
                return Err(format!(
                    "the chunk at byte {at} is compressed with {other:?}; expected none, lz4 or zstd (the mcap tool converts it)"
                ));
            }
        };
        // a checksum of 0 says that there is none
        let sound = unpacked.filter(|data| chunk.checksum == 0 || crc32fast::hash(data) == chunk.checksum);
        match sound {
            Some(data) => self.inner_records(&data),
            None => self.losses.push(format!("the chunk at byte {at} is damaged and left out")),
        }
        Ok(())
    }

    fn inner_records(&mut self, mut data: &[u8]) {
        while let Some((opcode, content, after)) = split_record(data) {
            if self.record(opcode, content).is_none() {
                self.losses.push("a record inside a chunk is damaged".to_owned());
            }
            data = after;
        }
    }

    /// Takes one record; `None` where it is damaged.
    fn record(&mut self, opcode: u8, content: &[u8]) -> Option<()> {
        let mut from = Cursor(content);
        match opcode {
            SCHEMA => {
                let id = from.u16()?;
                let (name, encoding) = (from.string()?, from.string()?);
                let size = from.u32()? as usize;
                let data = from.bytes(size)?.to_vec();
                self.schemas.insert(id, RawSchema { name, encoding, data });
            }
            CHANNEL => {
                let (id, schema) = (from.u16()?, from.u16()?);
                let (topic, encoding) = (from.string()?, from.string()?);
                let metadata = from.map()?;
                let schema = self.schemas.get(&schema).cloned();
                self.channels.entry(id).or_insert(RawChannel { topic, encoding, metadata, schema });
            }
            MESSAGE => {
                let channel = from.u16()?;
                let of_others = self.channels.get(&channel).is_some_and(|c| {
                    c.encoding == "cdr" && !c.schema.as_ref().is_some_and(|schema| super::cdr::is_read(&schema.name))
                });
                if self.only_read && of_others {
                    return Some(());
                }
                let message = RawMessage {
                    channel,
                    sequence: from.u32()?,
                    log_time: from.u64()?,
                    publish_time: from.u64()?,
                    data: from.0.to_vec(),
                };
                self.messages.push(message);
            }
            ATTACHMENT => {
                let summed = content.get(..content.len().checked_sub(4)?)?;
                let (_log_time, _create_time) = (from.u64()?, from.u64()?);
                let (name, media_type) = (from.string()?, from.string()?);
                let size = usize::try_from(from.u64()?).ok()?;
                let data = from.bytes(size)?.to_vec();
                let checksum = from.u32()?;
                if checksum != 0 && checksum != crc32fast::hash(summed) {
                    return None;
                }
                self.attachments.push(Attachment { name, media_type, data });
            }
            METADATA => {
                let name = from.string()?;
                self.metadata.push((name, from.map()?));
            }
            _ => {}
        }
        Some(())
    }
}

/// Opcode, content and what follows of the first record; `None` where it is not whole.
fn split_record(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let mut from = Cursor(bytes);
    let opcode = from.bytes(1)?.first().copied()?;
    let length = usize::try_from(from.u64()?).ok()?;
    let content = from.bytes(length)?;
    Some((opcode, content, from.0))
}

struct ChunkHead<'a> {
    uncompressed_size: u64,
    checksum: u32,
    compression: &'a str,
    compressed_size: u64,
    data: &'a [u8],
}

impl<'a> ChunkHead<'a> {
    fn parse(content: &'a [u8]) -> Option<Self> {
        let mut from = Cursor(content);
        let (_start, _end) = (from.u64()?, from.u64()?);
        let uncompressed_size = from.u64()?;
        let checksum = from.u32()?;
        let length = from.u32()? as usize;
        let compression = std::str::from_utf8(from.bytes(length)?).ok()?;
        let compressed_size = from.u64()?;
        Some(Self { uncompressed_size, checksum, compression, compressed_size, data: from.0 })
    }

    /// The packed records, where all of them are there.
    fn whole(&self) -> Option<&'a [u8]> {
        self.data.get(..usize::try_from(self.compressed_size).ok()?)
    }

    /// What follows the packed records, where all of them are there.
    fn after(&self) -> Option<&'a [u8]> {
        self.data.get(usize::try_from(self.compressed_size).ok()?..)
    }
}

/// The records of a chunk, which are `size` bytes as it says: of one with more, those behind would be lost in silence.
fn unpacked(from: impl Read, size: u64) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    from.take(size.min(LARGEST_CHUNK) + 1).read_to_end(&mut out).ok()?;
    (out.len() as u64 == size).then_some(out)
}

struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn string(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        String::from_utf8(self.bytes(length)?.to_vec()).ok()
    }

    fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let length = self.u32()? as usize;
        let mut inside = Cursor(self.bytes(length)?);
        let mut map = BTreeMap::new();
        while !inside.0.is_empty() {
            map.insert(inside.string()?, inside.string()?);
        }
        Some(map)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_packed_chunk_comes_back_and_one_that_is_shorter_or_longer_than_it_says_is_damaged() {
        use ruzstd::encoding::{CompressionLevel, compress_to_vec};
        // a metadata record: its name and an empty map
        let record = [&[METADATA, 9, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0][..], b"n", &[0; 4]].concat();
        let data = record.repeat(100);
        let zstd = compress_to_vec(&data[..], CompressionLevel::Fastest);
        let mut lz4 = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
        std::io::Write::write_all(&mut lz4, &data).unwrap();
        let lz4 = lz4.finish().0;
        for (compression, packed) in [("zstd", zstd), ("lz4", lz4), ("zstd", data.clone())] {
            for more in [0_i64, 1, -1, -18] {
                let mut content = vec![0; 16];
                content.extend((data.len() as i64 + more).to_le_bytes());
                content.extend([0; 4]);
                content.extend((compression.len() as u32).to_le_bytes());
                content.extend(compression.as_bytes());
                content.extend((packed.len() as u64).to_le_bytes());
                content.extend(&packed);
                let mut file = RawFile::default();
                file.chunk(&content, 8).unwrap();
                let whole = more == 0 && packed != data;
                assert_eq!(file.metadata.len(), if whole { 100 } else { 0 }, "{compression} {more}");
                let damaged: &[&str] = if whole { &[] } else { &["the chunk at byte 8 is damaged and left out"] };
                assert_eq!(file.losses, damaged, "{compression} {more}");
            }
        }
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = read_records(&bytes, true);
        }

        #[test]
        fn records_with_random_content_never_panic(opcode in 0_u8..0x10, content in proptest::collection::vec(any::<u8>(), 0..100)) {
            let mut bytes = vec![opcode];
            bytes.extend((content.len() as u64).to_le_bytes());
            bytes.extend(content);
            let _ = read_records(&bytes, true);
        }
    }
}
