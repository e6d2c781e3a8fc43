//! How is a plugin called in a process of its own, so that nothing it does ends this one?
//!
//! The scene lies in shared memory that the child may only read, mapped at the same address in both processes, so that
//! the flat structs are passed without being touched. The picture lies there, too, and the child may write it, between
//! pages that nobody may touch. Small messages go over a socket.

mod heap;
mod message;
mod peer;
mod picture;
mod process;
mod serve;

pub(crate) use peer::Peer;
pub(crate) use process::describe;
pub(crate) use serve::serve;
