//! A TCP proxy that misbehaves on purpose, between the compositor and a node.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// What happens to the bytes that a node sends, or is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    None,
    /// Connections are cut after so many bytes more, and new ones too, until healed.
    Cut {
        after: u64,
    },
    /// Nothing is forwarded any more after so many bytes, in either direction; connections stay open.
    Stall {
        after: u64,
    },
    /// One bit of the byte at this distance is flipped, once.
    Corrupt {
        after: u64,
    },
    /// The same of the bytes that the node is sent.
    CorruptOrder {
        after: u64,
    },
    /// So many bytes a second.
    Slow {
        rate: u64,
    },
}

#[derive(Debug)]
struct Shared {
    fault: Mutex<Fault>,
    /// Bytes from the node since the fault was set.
    passed: AtomicU64,
    /// Bytes to the node since then.
    sent: AtomicU64,
    /// How often the fault struck.
    hits: AtomicU64,
    stopped: AtomicBool,
    connections: AtomicU64,
    /// Both ends of what is connected, with the number of the connection.
    open: Mutex<Vec<(u64, TcpStream)>>,
}

/// A proxy in front of one node; its threads end when it is dropped.
#[derive(Debug)]
pub struct Proxy {
    pub address: String,
    shared: Arc<Shared>,
}

impl Proxy {
    /// Listens on a free loopback port, in front of the node at `target`.
    ///
    /// # Panics
    /// No port is free.
    #[must_use]
    pub fn start(target: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("an address").to_string();
        let shared = Arc::new(Shared {
            fault: Mutex::new(Fault::None),
            passed: AtomicU64::new(0),
            sent: AtomicU64::new(0),
            hits: AtomicU64::new(0),
            stopped: AtomicBool::new(false),
            connections: AtomicU64::new(0),
            open: Mutex::default(),
        });
        let (state, target) = (shared.clone(), target.to_owned());
        std::thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                if state.stopped.load(Ordering::SeqCst) {
                    return;
                }
                let cut =
                    matches!(*state.fault.lock().expect("no panic"), Fault::Cut { after } if state.passed() >= after);
                let Some(node) = TcpStream::connect(&target).ok().filter(|_| !cut) else { continue };
                state.pass(client, node);
            }
        });
        Self { address, shared }
    }

    /// From now on; the bytes are counted anew.
    pub fn set(&self, fault: Fault) {
        let mut now = self.shared.fault.lock().expect("no panic");
        self.shared.passed.store(0, Ordering::SeqCst);
        self.shared.sent.store(0, Ordering::SeqCst);
        self.shared.hits.store(0, Ordering::SeqCst);
        *now = fault;
    }

    /// How often the fault struck since it was set.
    #[must_use]
    pub fn hits(&self) -> u64 {
        self.shared.hits.load(Ordering::SeqCst)
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.shared.stopped.store(true, Ordering::SeqCst);
        self.shared.cut();
        // Wakes the thread that accepts.
        TcpStream::connect(&self.address).ok();
    }
}

impl Shared {
    fn passed(&self) -> u64 {
        self.passed.load(Ordering::SeqCst)
    }

    fn cut(&self) {
        for (_, stream) in self.open.lock().expect("no panic").drain(..) {
            stream.shutdown(Shutdown::Both).ok();
        }
    }

    fn pass(self: &Arc<Self>, client: TcpStream, node: TcpStream) {
        let copy = |s: &TcpStream| s.try_clone().expect("a handle");
        client.set_nodelay(true).ok();
        node.set_nodelay(true).ok();
        let number = self.connections.fetch_add(1, Ordering::SeqCst);
        self.open.lock().expect("no panic").extend([(number, copy(&client)), (number, copy(&node))]);
        let (up, down) = ((copy(&client), copy(&node)), (node, client));
        for ((from, to), from_node) in [(up, false), (down, true)] {
            let shared = self.clone();
            std::thread::spawn(move || {
                shared.forward(&from, &to, from_node);
                from.shutdown(Shutdown::Both).ok();
                to.shutdown(Shutdown::Both).ok();
                // What nobody uses any more must not stay open: thousands come in a long test.
                shared.open.lock().expect("no panic").retain(|(of, _)| *of != number);
            });
        }
    }

    fn forward(&self, mut from: &TcpStream, mut to: &TcpStream, from_node: bool) {
        // Small, so that faults strike in the middle of things.
        let mut buffer = [0; 4096];
        loop {
            let Ok(got) = from.read(&mut buffer) else { return };
            if got == 0 {
                return;
            }
            let bytes = &mut buffer[..got];
            let own = if from_node { &self.passed } else { &self.sent };
            let own_before = own.fetch_add(got as u64, Ordering::SeqCst);
            let before = if from_node { own_before } else { self.passed() };
            let fault = *self.fault.lock().expect("no panic");
            let end = before + got as u64;
            match fault {
                Fault::Cut { after } if end > after => {
                    self.hits.fetch_add(1, Ordering::SeqCst);
                    self.cut();
                    return;
                }
                Fault::Stall { after } if end > after => {
                    self.hits.fetch_add(1, Ordering::SeqCst);
                    while *self.fault.lock().expect("no panic") == fault && !self.stopped.load(Ordering::SeqCst) {
                        std::thread::sleep(Duration::from_millis(10));
                    }
                }
                Fault::Corrupt { after } | Fault::CorruptOrder { after }
                    if from_node == matches!(fault, Fault::Corrupt { .. })
                        && own_before <= after
                        && after < own_before + got as u64 =>
                {
                    self.hits.fetch_add(1, Ordering::SeqCst);
                    bytes[(after - own_before) as usize] ^= 0x10;
                }
                Fault::Slow { rate } if from_node => {
                    self.hits.fetch_add(1, Ordering::SeqCst);
                    std::thread::sleep(Duration::from_secs_f64(got as f64 / rate as f64));
                }
                _ => {}
            }
            if to.write_all(bytes).is_err() {
                return;
            }
        }
    }
}
