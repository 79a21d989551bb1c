//! Where a virtual receiver answers: on a pseudo-terminal, or on a TCP port as behind a serial device server.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

use super::CellError;
use crate::gauge::port::is_not_yet;

/// How long a read waits for something to come.
const PATIENCE: Duration = Duration::from_millis(20);

pub(super) enum Wire {
    #[cfg(unix)]
    Terminal(terminal::Terminal),
    /// Who came last is heard.
    Tcp { listener: TcpListener, client: Option<TcpStream> },
}

impl Wire {
    /// On a TCP port of this computer (0 = any that is free), or, without one, on a pseudo-terminal where there are any; with its place in the
    /// URL of a gauge.
    pub(super) fn open(port: Option<u16>) -> Result<(Self, String), CellError> {
        #[cfg(unix)]
        if port.is_none() {
            let (terminal, path) =
                terminal::Terminal::open().map_err(|error| CellError::PseudoTerminal { reason: error.to_string() })?;
            return Ok((Self::Terminal(terminal), path.display().to_string()));
        }
        let (listener, address) = listen("virtual receiver", port.unwrap_or(0))?;
        Ok((Self::Tcp { listener, client: None }, address.to_string()))
    }

    /// How many bytes came within a moment; 0 too where nobody has the other side open.
    pub(super) fn read(&mut self, bytes: &mut [u8]) -> usize {
        match self {
            #[cfg(unix)]
            Self::Terminal(terminal) => terminal.read(bytes),
            Self::Tcp { listener, client } => {
                if let Ok((new, _)) = listener.accept() {
                    let ready = new.set_nonblocking(false).and_then(|()| new.set_nodelay(true));
                    *client = ready.and_then(|()| new.set_read_timeout(Some(PATIENCE))).is_ok().then_some(new);
                }
                match client.as_mut().map(|client| client.read(bytes)) {
                    Some(Ok(count)) if count > 0 => return count,
                    Some(Err(error)) if is_not_yet(&error) => {}
                    _ => {
                        *client = None;
                        std::thread::sleep(PATIENCE / 4);
                    }
                }
                0
            }
        }
    }

    pub(super) fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let to: &mut dyn Write = match self {
            #[cfg(unix)]
            Self::Terminal(terminal) => &mut terminal.master,
            Self::Tcp { client: Some(client), .. } => client,
            Self::Tcp { client: None, .. } => return Err(io::ErrorKind::NotConnected.into()),
        };
        to.write_all(bytes).and_then(|()| to.flush())
    }
}

/// Listens on a TCP port of this computer, without blocking who asks.
pub(super) fn listen(who: &'static str, port: u16) -> Result<(TcpListener, SocketAddr), CellError> {
    let address = SocketAddr::from(([127, 0, 0, 1], port));
    let listener = TcpListener::bind(address).and_then(|listener| {
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        Ok((listener, address))
    });
    listener.map_err(|error| match error.kind() {
        io::ErrorKind::AddrInUse => CellError::PortInUse { who, address },
        _ => CellError::Port { who, address, reason: error.to_string() },
    })
}

#[cfg(unix)]
mod terminal {
    use std::fs::File;
    use std::io::Read;
    use std::os::fd::{AsFd, OwnedFd};
    use std::path::PathBuf;

    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
    use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};

    use super::PATIENCE;

    pub(in super::super) struct Terminal {
        pub(super) master: File,
        /// Kept open, so that the terminal stays raw while nobody else has it.
        _slave: OwnedFd,
    }

    impl Terminal {
        /// With the path of its other side.
        pub(super) fn open() -> nix::Result<(Self, PathBuf)> {
            let pair = nix::pty::openpty(None, None)?;
            let mut settings = tcgetattr(&pair.slave)?;
            cfmakeraw(&mut settings);
            tcsetattr(&pair.slave, SetArg::TCSANOW, &settings)?;
            let path = nix::unistd::ttyname(&pair.slave)?;
            Ok((Self { master: File::from(pair.master), _slave: pair.slave }, path))
        }

        pub(super) fn read(&mut self, bytes: &mut [u8]) -> usize {
            let mut fds = [PollFd::new(self.master.as_fd(), PollFlags::POLLIN)];
            let patience = PollTimeout::try_from(PATIENCE).unwrap_or(PollTimeout::ZERO);
            if poll(&mut fds, patience).unwrap_or(0) == 0 {
                return 0;
            }
            let count = self.master.read(bytes).unwrap_or(0);
            if count == 0 {
                // nobody has the other side open
                std::thread::sleep(PATIENCE / 2);
            }
            count
        }
    }
}
