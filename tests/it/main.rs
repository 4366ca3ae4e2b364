//! Everything that is tested through the public interface, linked once.

mod avatars;
mod golden;
mod readers;
mod verbs;
