//! Bodies through the public interface, linked once.

mod families;
mod reference;
mod retopology;
