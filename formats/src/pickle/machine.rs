//! The stack machine: opcodes to nodes.
//!
//! Opcodes as in CPython's `pickletools.py`. The machine never looks a name up: a global is its name until
//! [`super::callables`] recognises it where it is called. Every opcode consumes at least its own byte, so the number of
//! nodes is bounded by the file's length; what they hold comes out of the file's budget.

use std::collections::HashMap;

use super::cursor::Cursor;
use super::literals;
use super::node::{Node, NodeId};
use super::tensors::Storages;
use super::value::Value;
use crate::budget::Budget;
use crate::fault::Fault;

/// The newest protocol that the opcodes below belong to.
const NEWEST_PROTOCOL: u8 = 5;
/// What an entry of the memo takes at most, while the table moves to twice its size.
const MEMO_ENTRY_BYTES: usize = 32;

pub(super) struct Machine<'a> {
    pub(super) cursor: Cursor<'a>,
    /// Where the opcode being executed starts.
    opcode_at: usize,
    pub(super) nodes: Vec<Node<'a>>,
    stack: Vec<NodeId>,
    /// Stack heights at which marks stand.
    marks: Vec<usize>,
    memo: HashMap<u32, NodeId>,
    pub(super) budget: &'a Budget,
    pub(super) outside: Outside<'a>,
}

/// Where persistent ids lead to.
#[derive(Clone, Copy)]
pub(super) enum Outside<'a> {
    /// Nowhere: the pickle is a file of its own.
    Nowhere,
    /// To the members of an archive.
    Members(&'a Storages<'a>),
    /// To numbers behind the pickle: an id stays an id.
    Behind,
}

impl<'a> Machine<'a> {
    /// A machine for a pickle, which may take what `budget` allows.
    pub(super) fn new(bytes: &'a [u8], outside: Outside<'a>, budget: &'a Budget) -> Self {
        Self {
            cursor: Cursor::new(bytes),
            opcode_at: 0,
            nodes: Vec::new(),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: HashMap::new(),
            budget,
            outside,
        }
    }

    /// Executes the pickle up to its STOP and returns what it built.
    pub(super) fn run(mut self) -> Result<Value, Fault> {
        let root = self.run_to_stop()?;
        self.into_value(root)
    }

    /// Executes a pickle up to its STOP; what it built is a node. The next bytes may be another pickle.
    pub(super) fn run_to_stop(&mut self) -> Result<NodeId, Fault> {
        self.memo.clear();
        loop {
            self.opcode_at = self.cursor.position();
            match self.cursor.byte()? {
                b'.' => return self.pop(),
                opcode => self.execute(opcode)?,
            }
        }
    }

    fn execute(&mut self, opcode: u8) -> Result<(), Fault> {
        match opcode {
            // Framing
            0x80 => self.protocol(),
            0x95 => self.cursor.array::<8>().map(drop),

            // Constants
            b'N' => self.push(Node::None),
            0x88 => self.push(Node::Bool(true)),
            0x89 => self.push(Node::Bool(false)),

            // Numbers
            b'I' => self.push_literal(literals::decimal_or_bool),
            b'L' => self.push_literal(literals::decimal_long),
            b'J' => self.push_literal(|cursor| Ok(Node::Int(i32::from_le_bytes(cursor.array()?).into()))),
            b'K' => self.push_literal(|cursor| Ok(Node::Int(cursor.byte()?.into()))),
            b'M' => self.push_literal(|cursor| Ok(Node::Int(u16::from_le_bytes(cursor.array()?).into()))),
            0x8a => self.push_literal(literals::long::<1>),
            0x8b => self.push_literal(literals::long::<4>),
            b'F' => self.push_literal(literals::decimal_float),
            b'G' => self.push_literal(|cursor| Ok(Node::Float(f64::from_be_bytes(cursor.array()?)))),

            // Text and bytes
            b'V' => self.push_literal(literals::escaped_unicode),
            b'X' => self.push_literal(literals::text::<4>),
            0x8c => self.push_literal(literals::text::<1>),
            0x8d => self.push_literal(literals::text::<8>),
            b'S' => self.push_literal(literals::quoted_string),
            b'T' => self.push_literal(literals::python2_string::<4>),
            b'U' => self.push_literal(literals::python2_string::<1>),
            b'B' => self.push_literal(literals::bytes::<4>),
            b'C' => self.push_literal(literals::bytes::<1>),
            0x8e | 0x96 => self.push_literal(literals::bytes::<8>),

            // Containers
            b']' => self.push(Node::List(Vec::new())),
            b')' => self.push(Node::Tuple(Vec::new())),
            b'}' => self.push(Node::Dict(Vec::new())),
            b'l' => self.push_marked(Node::List),
            b't' => self.push_marked(Node::Tuple),
            b'd' => self.marked_dict(),
            0x85 => self.tuple(1),
            0x86 => self.tuple(2),
            0x87 => self.tuple(3),
            b'a' => {
                let item = self.pop()?;
                self.append(vec![item])
            }
            b'e' => {
                let items = self.pop_marked()?;
                self.append(items)
            }
            b's' => {
                let value = self.pop()?;
                let key = self.pop()?;
                self.set_items(vec![key, value])
            }
            b'u' => {
                let items = self.pop_marked()?;
                self.set_items(items)
            }

            // Stack and memo
            b'(' => {
                let height = self.stack.len();
                self.budget.push(&mut self.marks, height, "marks")
            }
            b'0' => self.pop_value_or_mark(),
            b'1' => self.pop_marked().map(drop),
            b'2' => {
                let top = self.top()?;
                self.push_id(top)
            }
            b'p' => {
                let index = literals::decimal_index(&mut self.cursor)?;
                self.memoise(index)
            }
            b'q' => {
                let index = self.cursor.byte()?.into();
                self.memoise(index)
            }
            b'r' => {
                let index = u32::from_le_bytes(self.cursor.array()?);
                self.memoise(index)
            }
            0x94 => self.memoise(self.memo.len() as u32),
            b'g' => {
                let index = literals::decimal_index(&mut self.cursor)?;
                self.recall(index)
            }
            b'h' => {
                let index = self.cursor.byte()?.into();
                self.recall(index)
            }
            b'j' => {
                let index = u32::from_le_bytes(self.cursor.array()?);
                self.recall(index)
            }

            // Functions, classes and their instances: see callables.rs
            b'c' => {
                let (module, name) = (self.cursor.line()?, self.cursor.line()?);
                self.push_global(module, name)
            }
            0x93 => self.stack_global(),
            b'R' | 0x81 => {
                let arguments = self.pop()?;
                let callable = self.pop()?;
                self.call_and_push(callable, arguments)
            }
            b'b' => {
                let state = self.pop()?;
                let target = self.top()?;
                self.set_state(target, state)
            }
            b'o' => {
                let mut parts = self.pop_marked()?.into_iter();
                let class = parts.next().ok_or_else(|| self.broken("an empty mark", "a class after the mark"))?;
                self.construct_and_push(class, parts.collect())
            }
            b'i' => {
                let (module, name) = (self.cursor.line()?, self.cursor.line()?);
                let arguments = self.pop_marked()?;
                self.push_global(module, name)?;
                let class = self.pop()?;
                self.construct_and_push(class, arguments)
            }

            // What only an application can resolve
            b'Q' => {
                let id = self.pop()?;
                match self.outside {
                    Outside::Members(storages) => {
                        let node = self.stored_in(storages, id)?;
                        self.push(node)
                    }
                    Outside::Behind => self.push_id(id),
                    Outside::Nowhere => Err(Fault::refused("an object stored outside the pickle (a persistent id)")),
                }
            }
            b'P' => Err(Fault::refused("an object stored outside the pickle (a persistent id)")),
            0x97 | 0x98 => Err(Fault::refused("a buffer stored outside the pickle")),
            0x82..=0x84 => Err(Fault::refused("an object of the extension registry")),
            0x92 => Err(Fault::refused("an object constructed with keyword arguments")),
            0x8f..=0x91 => Err(Fault::refused("a set")),
            other => Err(self.broken(format_args!("opcode {other:#04x}"), "an opcode of protocols 0 to 5")),
        }
    }

    // -- faults

    /// A fault at the opcode being executed.
    pub(super) fn broken(&self, found: impl std::fmt::Display, expected: impl std::fmt::Display) -> Fault {
        Fault::malformed(format_args!("byte {}", self.opcode_at), found, expected)
    }

    // -- stack

    pub(super) fn add(&mut self, node: Node<'a>) -> Result<NodeId, Fault> {
        let id = NodeId::try_from(self.nodes.len()).map_err(|_| self.broken("more than 2^32 objects", "fewer"))?;
        self.budget.push(&mut self.nodes, node, "objects")?;
        Ok(id)
    }

    fn push(&mut self, node: Node<'a>) -> Result<(), Fault> {
        let id = self.add(node)?;
        self.push_id(id)
    }

    fn push_id(&mut self, id: NodeId) -> Result<(), Fault> {
        self.budget.push(&mut self.stack, id, "a stack")
    }

    fn push_literal(&mut self, read: impl FnOnce(&mut Cursor<'a>) -> Result<Node<'a>, Fault>) -> Result<(), Fault> {
        let node = read(&mut self.cursor)?;
        self.push(node)
    }

    /// The height below which the stack belongs to what stands before the last mark.
    fn floor(&self) -> usize {
        self.marks.last().copied().unwrap_or(0)
    }

    fn top(&self) -> Result<NodeId, Fault> {
        let own = &self.stack[self.floor()..];
        own.last().copied().ok_or_else(|| self.broken("an empty stack", "a value on the stack"))
    }

    fn pop(&mut self) -> Result<NodeId, Fault> {
        let top = self.top()?;
        self.stack.pop();
        Ok(top)
    }

    /// Protocol 0 drops a mark by popping it like a value.
    fn pop_value_or_mark(&mut self) -> Result<(), Fault> {
        if self.marks.last() == Some(&self.stack.len()) {
            self.marks.pop();
            return Ok(());
        }
        self.pop().map(drop)
    }

    /// Everything above the last mark, which is removed.
    fn pop_marked(&mut self) -> Result<Vec<NodeId>, Fault> {
        let mark = self.marks.pop().ok_or_else(|| self.broken("no mark", "a mark on the stack"))?;
        self.split_off(mark)
    }

    /// The stack from height `start` on, which is removed.
    fn split_off(&mut self, start: usize) -> Result<Vec<NodeId>, Fault> {
        let mut items = self.budget.vector(self.stack.len() - start, "items")?;
        items.extend(self.stack.drain(start..));
        Ok(items)
    }

    fn push_marked(&mut self, container: fn(Vec<NodeId>) -> Node<'a>) -> Result<(), Fault> {
        let items = self.pop_marked()?;
        self.push(container(items))
    }

    // -- containers

    fn tuple(&mut self, length: usize) -> Result<(), Fault> {
        let start = self.stack.len().checked_sub(length).filter(|&start| start >= self.floor());
        let start = start.ok_or_else(|| self.broken("too short a stack", format_args!("{length} values")))?;
        let items = self.split_off(start)?;
        self.push(Node::Tuple(items))
    }

    fn marked_dict(&mut self) -> Result<(), Fault> {
        let items = self.pop_marked()?;
        self.push(Node::Dict(Vec::new()))?;
        self.set_items(items)
    }

    fn append(&mut self, new: Vec<NodeId>) -> Result<(), Fault> {
        let list = self.top()?;
        match &mut self.nodes[list as usize] {
            Node::List(items) => {
                new.into_iter().try_for_each(|item| self.budget.push(items, item, "a list"))?;
            }
            Node::PassedOver => {}
            other => {
                let found = other.kind();
                return Err(self.broken(found, "a list to append to"));
            }
        }
        Ok(())
    }

    fn set_items(&mut self, keys_and_values: Vec<NodeId>) -> Result<(), Fault> {
        let dict = self.top()?;
        let (pairs, []) = keys_and_values.as_chunks::<2>() else {
            return Err(self.broken("a key without a value", "pairs"));
        };
        match &mut self.nodes[dict as usize] {
            Node::Dict(entries) => {
                pairs.iter().try_for_each(|&[key, value]| self.budget.push(entries, (key, value), "a dict"))?;
            }
            Node::PassedOver => {}
            other => {
                let found = other.kind();
                return Err(self.broken(found, "a dict to set entries of"));
            }
        }
        Ok(())
    }

    // -- memo

    fn memoise(&mut self, index: u32) -> Result<(), Fault> {
        let top = self.top()?;
        if self.memo.insert(index, top).is_none() {
            self.budget.spend(MEMO_ENTRY_BYTES, "a memo")?;
        }
        Ok(())
    }

    fn recall(&mut self, index: u32) -> Result<(), Fault> {
        let remembered = self.memo.get(&index).copied();
        let remembered = remembered.ok_or_else(|| self.broken(format_args!("memo {index}"), "a memo set before"))?;
        self.push_id(remembered)
    }

    // -- globals

    fn push_global(&mut self, module: &str, name: &str) -> Result<(), Fault> {
        self.budget.spend(module.len() + name.len(), "names")?;
        self.push(Node::Global(format!("{module}.{name}").into()))
    }

    fn stack_global(&mut self) -> Result<(), Fault> {
        let (name, module) = (self.pop()?, self.pop()?);
        let (Node::Text(module), Node::Text(name)) = (&self.nodes[module as usize], &self.nodes[name as usize]) else {
            return Err(self.broken("something else", "a module and a name"));
        };
        let (module, name) = (module.clone(), name.clone());
        self.push_global(&module, &name)
    }

    fn call_and_push(&mut self, callable: NodeId, arguments: NodeId) -> Result<(), Fault> {
        let Node::Tuple(arguments) = &self.nodes[arguments as usize] else {
            return Err(self.broken(self.nodes[arguments as usize].kind(), "a tuple of arguments"));
        };
        // Called repeatedly on one memoised tuple, these copies are what grows.
        let (length, arguments) = (arguments.len(), arguments.as_slice());
        let mut copied = self.budget.vector(length, "arguments")?;
        copied.extend_from_slice(arguments);
        self.construct_and_push(callable, copied)
    }

    fn construct_and_push(&mut self, callable: NodeId, arguments: Vec<NodeId>) -> Result<(), Fault> {
        let node = self.call(callable, &arguments)?;
        self.push(node)
    }

    fn protocol(&mut self) -> Result<(), Fault> {
        match self.cursor.byte()? {
            protocol if protocol <= NEWEST_PROTOCOL => Ok(()),
            other => Err(self.broken(format_args!("protocol {other}"), "protocol 0 to 5")),
        }
    }
}
