//! The wire between the virtual receiver and who reads it: a pseudo-terminal, or a TCP port.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

/// So long is waited for bytes.
const WAIT: Duration = Duration::from_millis(20);

/// Where bytes come in and go out.
pub(super) trait Wire: Send {
    /// What has come within a few milliseconds; nothing where nothing came or nobody is there.
    fn read(&mut self, bytes: &mut [u8]) -> usize;

    /// Sends all.
    ///
    /// # Errors
    /// Nobody is there any more.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;
}

/// A pseudo-terminal, and its path.
#[cfg(unix)]
pub(super) fn terminal() -> io::Result<(Box<dyn Wire>, String)> {
    use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
    let pair = nix::pty::openpty(None, None)?;
    let mut settings = tcgetattr(&pair.slave)?;
    cfmakeraw(&mut settings);
    tcsetattr(&pair.slave, SetArg::TCSANOW, &settings)?;
    let path = nix::unistd::ttyname(&pair.slave)?;
    let wire = unix::Terminal { master: pair.master.into(), _slave: pair.slave };
    Ok((Box::new(wire), path.display().to_string()))
}

/// Windows has none whose other end is opened by a name.
#[cfg(not(unix))]
pub(super) fn terminal() -> io::Result<(Box<dyn Wire>, String)> {
    Err(io::ErrorKind::Unsupported.into())
}

/// A TCP port, and its address.
pub(super) fn tcp(address: SocketAddr) -> io::Result<(Box<dyn Wire>, String)> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?.to_string();
    Ok((Box::new(Tcp { listener, client: None }), address))
}

#[cfg(unix)]
mod unix {
    use std::fs::File;
    use std::os::fd::{AsFd, OwnedFd};

    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

    use super::{Duration, Read, WAIT, Wire, Write, io};

    pub(super) struct Terminal {
        pub(super) master: File,
        /// Kept open, so that the terminal stays raw while nobody else has it.
        pub(super) _slave: OwnedFd,
    }

    impl Wire for Terminal {
        fn read(&mut self, bytes: &mut [u8]) -> usize {
            let ready = {
                let mut fds = [PollFd::new(self.master.as_fd(), PollFlags::POLLIN)];
                poll(&mut fds, PollTimeout::try_from(WAIT).unwrap_or(PollTimeout::ZERO)).unwrap_or(0)
            };
            if ready == 0 {
                return 0;
            }
            match self.master.read(bytes) {
                Ok(count) if count > 0 => count,
                // nobody has the other side open
                _ => {
                    std::thread::sleep(Duration::from_millis(10));
                    0
                }
            }
        }

        fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.master.write_all(bytes)?;
            self.master.flush()
        }
    }
}

/// One client at a time; the next one waits until it has gone.
struct Tcp {
    listener: TcpListener,
    client: Option<TcpStream>,
}

impl Tcp {
    fn accept(&self) -> io::Result<TcpStream> {
        let (client, _) = self.listener.accept()?;
        client.set_nonblocking(false)?;
        client.set_nodelay(true)?;
        client.set_read_timeout(Some(WAIT))?;
        Ok(client)
    }
}

impl Wire for Tcp {
    fn read(&mut self, bytes: &mut [u8]) -> usize {
        let Some(client) = &mut self.client else {
            match self.accept() {
                Ok(client) => self.client = Some(client),
                Err(_) => std::thread::sleep(Duration::from_millis(5)),
            }
            return 0;
        };
        match client.read(bytes) {
            Ok(count) if count > 0 => count,
            Err(error) if crate::gauge::port::is_not_yet(&error) => 0,
            _ => {
                self.client = None;
                0
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.client.as_mut().map_or(Err(io::ErrorKind::NotConnected.into()), |client| client.write_all(bytes))
    }
}
