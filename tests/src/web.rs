//! A plain HTTP server over a folder, or in front of another server, that misbehaves on purpose.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use brickcast_volume::small_file::open_regular;

/// What happens to requests.
#[derive(Debug, Clone, Default)]
pub struct Manners {
    /// Before each answer.
    pub delay: Duration,
    /// One request of so many fails, in turn: with status 503, by a connection that is cut before the answer, or in the
    /// middle of it. Never for 0.
    pub fails_one_in: u64,
    /// After so many requests it is gone: connections are cut at once.
    pub gone_after: Option<u64>,
    /// This bit of the file whose path ends so is flipped: path, byte, bit.
    pub flips: Option<(String, u64, u32)>,
    /// Every answer has this status, and no body.
    pub status: Option<u16>,
    /// Ranges are not looked at.
    pub without_ranges: bool,
    /// Answers of data have no end.
    pub endless: bool,
}

#[derive(Debug)]
struct Shared {
    folder: PathBuf,
    manners: Mutex<Manners>,
    requests: AtomicU64,
    /// Requests that failed on purpose.
    failed: AtomicU64,
    stopped: AtomicBool,
    asked: Mutex<Vec<String>>,
}

/// A running server; its threads end when it is dropped and its clients have gone.
#[derive(Debug)]
pub struct WebServer {
    /// `http://127.0.0.1:PORT`
    pub address: String,
    shared: Arc<Shared>,
}

/// What was asked for.
struct Request {
    is_head: bool,
    path: String,
    /// First and last byte.
    range: Option<(u64, u64)>,
    if_match: Option<String>,
}

impl WebServer {
    /// Serves what lies below `folder` on a free loopback port.
    ///
    /// # Panics
    /// No port is free.
    #[must_use]
    pub fn start(folder: &Path) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = format!("http://{}", listener.local_addr().expect("an address"));
        let shared = Arc::new(Shared {
            folder: folder.to_path_buf(),
            manners: Mutex::default(),
            requests: AtomicU64::new(0),
            failed: AtomicU64::new(0),
            stopped: AtomicBool::new(false),
            asked: Mutex::default(),
        });
        let state = shared.clone();
        std::thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                if state.stopped.load(Ordering::SeqCst) {
                    return;
                }
                let state = state.clone();
                std::thread::spawn(move || {
                    state.serve(&client);
                    client.shutdown(Shutdown::Both).ok();
                });
            }
        });
        Self { address, shared }
    }

    /// From now on; requests are counted anew.
    ///
    /// # Panics
    /// Never: a thread of the server panicked.
    pub fn set(&self, manners: Manners) {
        let mut now = self.shared.manners.lock().expect("no panic");
        self.shared.requests.store(0, Ordering::SeqCst);
        self.shared.failed.store(0, Ordering::SeqCst);
        self.shared.asked.lock().expect("no panic").clear();
        *now = manners;
    }

    /// Requests since the manners were set.
    #[must_use]
    pub fn requests(&self) -> u64 {
        self.shared.requests.load(Ordering::SeqCst)
    }

    /// Of these, how many failed on purpose.
    #[must_use]
    pub fn failed(&self) -> u64 {
        self.shared.failed.load(Ordering::SeqCst)
    }

    /// The paths that were asked for since then.
    ///
    /// # Panics
    /// Never: a thread of the server panicked.
    #[must_use]
    pub fn asked(&self) -> Vec<String> {
        self.shared.asked.lock().expect("no panic").clone()
    }
}

impl Drop for WebServer {
    fn drop(&mut self) {
        self.shared.stopped.store(true, Ordering::SeqCst);
        // Wakes the thread that accepts.
        TcpStream::connect(self.address.trim_start_matches("http://")).ok();
    }
}

impl Shared {
    /// Answers until the client goes, or is to be cut.
    fn serve(&self, client: &TcpStream) {
        client.set_nodelay(true).ok();
        let mut reader = BufReader::new(client);
        while let Some(request) = read_request(&mut reader) {
            if self.stopped.load(Ordering::SeqCst) || self.answer(client, &request).is_none() {
                return;
            }
        }
    }

    /// Nothing where the connection is to be cut.
    fn answer(&self, mut client: &TcpStream, request: &Request) -> Option<()> {
        let manners = self.manners.lock().expect("no panic").clone();
        let number = self.requests.fetch_add(1, Ordering::SeqCst) + 1;
        self.asked.lock().expect("no panic").push(request.path.clone());
        std::thread::sleep(manners.delay);
        if manners.gone_after.is_some_and(|after| number > after) {
            return None;
        }
        let mut plain = |status: u16| client.write_all(head(status, "", 0).as_bytes()).ok();
        let fails = manners.fails_one_in > 0 && number.is_multiple_of(manners.fails_one_in);
        let way = if fails { self.failed.fetch_add(1, Ordering::SeqCst) % 3 } else { 9 };
        match (manners.status, way) {
            (Some(status), _) => return plain(status),
            (_, 0) => return plain(503),
            (_, 1) => return None,
            _ => {}
        }
        let Some((mut file, size)) = self.open(&request.path) else { return plain(404) };
        let tag = format!("ETag: \"{size:x}\"\r\n");
        if request.if_match.as_ref().is_some_and(|want| !tag.contains(want)) {
            return plain(412);
        }
        let asked = request.range.filter(|_| !manners.without_ranges);
        let (status, start, end) = match asked {
            None => (200, 0, size),
            Some((first, last)) if first < size && first <= last => (206, first, size.min(last + 1)),
            Some(_) => return plain(416),
        };
        let length = end - start;
        let range =
            if status == 206 { format!("Content-Range: bytes {start}-{}/{size}\r\n", end - 1) } else { String::new() };
        let mut body = vec![0; if request.is_head { 0 } else { length as usize }];
        file.seek(SeekFrom::Start(start)).ok()?;
        file.read_exact(&mut body).ok()?;
        if let Some((path, byte, bit)) = manners.flips
            && request.path.ends_with(&path)
            && let Some(flipped) = byte.checked_sub(start).and_then(|at| body.get_mut(usize::try_from(at).ok()?))
        {
            *flipped ^= 1 << bit;
            self.failed.fetch_add(1, Ordering::SeqCst);
        }
        if manners.endless && !request.is_head {
            client.write_all(head(status, &format!("{tag}{range}"), 1 << 50).as_bytes()).ok()?;
            let piece = [7; 0x10000];
            while !self.stopped.load(Ordering::SeqCst) {
                client.write_all(&piece).ok()?;
            }
            return None;
        }
        client.write_all(head(status, &format!("{tag}{range}"), length).as_bytes()).ok()?;
        if way == 2 && !body.is_empty() {
            client.write_all(&body[..body.len() / 2]).ok()?;
            return None;
        }
        client.write_all(&body).ok()
    }

    fn open(&self, path: &str) -> Option<(File, u64)> {
        let path = path.trim_start_matches('/');
        if path.split('/').any(|part| part == "..") {
            return None;
        }
        let file = open_regular(&self.folder.join(path)).ok()?;
        let metadata = file.metadata().ok()?;
        metadata.is_file().then_some((file, metadata.len()))
    }
}

fn head(status: u16, lines: &str, length: u64) -> String {
    format!("HTTP/1.1 {status} X\r\n{lines}Content-Length: {length}\r\n\r\n")
}

fn read_request(reader: &mut BufReader<&TcpStream>) -> Option<Request> {
    let mut line = || {
        let mut line = String::new();
        reader.read_line(&mut line).ok().filter(|read| *read > 0)?;
        Some(line.trim_end().to_owned())
    };
    let first = line()?;
    let mut words = first.split(' ');
    let (method, path) = (words.next()?, words.next()?.to_owned());
    let mut request = Request { is_head: method == "HEAD", path, range: None, if_match: None };
    loop {
        let line = line()?;
        let Some((name, value)) = line.split_once(": ") else { return line.is_empty().then_some(request) };
        match name.to_ascii_lowercase().as_str() {
            "range" => {
                let (first, last) = value.strip_prefix("bytes=")?.split_once('-')?;
                request.range = Some((first.parse().ok()?, last.parse().ok()?));
            }
            "if-match" => request.if_match = Some(value.to_owned()),
            _ => {}
        }
    }
}
