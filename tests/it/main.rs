//! Everything that is tested through the public interface, linked once.

mod avatars;
mod golden;
mod ground;
mod readers;
mod verbs;
