//! Ports of a service. Behind each stands a trait object: iceoryx2, which is heavily generic, is then compiled for this
//! crate alone (ADR 19), and no other crate can make a port in another way.

use super::Ipc;
use super::wire::Wire;
use bytemuck::{Pod, TransparentWrapper};
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{publisher, subscriber};
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::Service;
use iceoryx2::service::dynamic_config::publish_subscribe::DynamicConfig;
use std::cell::{Cell, RefCell};
use std::fmt::Debug;

/// Failure to send.
#[derive(Debug, thiserror::Error)]
#[error("no room in shared memory: {0}")]
pub struct SendError(String);

impl SendError {
    fn of(why: impl Debug) -> Self {
        Self(format!("{why:?}"))
    }
}

/// Sends single values.
pub struct Publisher<T>(Box<dyn Sends<T>>);

/// Receives single values.
pub struct Subscriber<T>(Box<dyn Fn() -> Option<(u128, T)>>);

/// Sends slices under a header.
pub struct SlicePublisher<T, H>(Box<dyn SendsSlices<T, H>>);

/// Receives slices under a header.
pub struct SliceSubscriber<T, H>(Box<dyn Fn() -> Option<Slice<T, H>>>);

/// A slice in shared memory, read in place.
pub struct Slice<T, H>(Box<dyn Held<T, H>>);

/// A slice in shared memory to fill and send.
pub struct Loan<T, H>(Box<dyn Loaned<T, H>>);

trait Sends<T> {
    fn send(&self, value: T) -> Result<usize, SendError>;
    fn connect(&self);
}

trait SendsSlices<T, H> {
    fn send(&self, header: &H, values: &[T]) -> Result<usize, SendError>;
    fn loan(&self, length: usize) -> Option<Loan<T, H>>;
    fn connect(&self);
}

trait Held<T, H> {
    fn header(&self) -> &H;
    fn values(&self) -> &[T];
}

trait Loaned<T, H> {
    fn parts(&mut self) -> (*mut H, *mut T);
    fn send(self: Box<Self>) -> Result<usize, SendError>;
}

impl<T: Pod + Debug> Sends<T> for publisher::Publisher<Ipc, Wire<T>, ()> {
    fn send(&self, value: T) -> Result<usize, SendError> {
        self.send_copy(Wire(value)).map_err(SendError::of)
    }

    fn connect(&self) {
        // A host that cannot be connected now is connected next time.
        let _ = self.update_connections();
    }
}

/// A port with fixed memory. A slice longer than those before it gets a new port, which replaces the old one: a port of
/// iceoryx2 0.10 that grows ends the program once more slices are held than it began with.
struct Growing<T: Pod + Debug, H: Pod + Debug, F> {
    port: RefCell<publisher::Publisher<Ipc, [Wire<T>], Wire<H>>>,
    length: Cell<usize>,
    make: F,
}

impl<T, H, F> Growing<T, H, F>
where
    T: Pod + Debug,
    H: Pod + Debug + Default,
    F: Fn(usize) -> Result<publisher::Publisher<Ipc, [Wire<T>], Wire<H>>, PublisherCreateError>,
{
    fn make_room(&self, length: usize) -> Result<(), SendError> {
        if length > self.length.get() {
            let enough = length.next_power_of_two();
            self.port.replace((self.make)(enough).map_err(SendError::of)?);
            self.length.set(enough);
        }
        Ok(())
    }
}

impl<T, H, F> SendsSlices<T, H> for Growing<T, H, F>
where
    T: Pod + Debug,
    H: Pod + Debug + Default,
    F: Fn(usize) -> Result<publisher::Publisher<Ipc, [Wire<T>], Wire<H>>, PublisherCreateError>,
{
    fn send(&self, header: &H, values: &[T]) -> Result<usize, SendError> {
        self.make_room(values.len())?;
        let port = self.port.borrow();
        let mut sample = port.loan_slice_uninit(values.len()).map_err(SendError::of)?;
        *sample.user_header_mut() = Wire(*header);
        sample
            .write_from_slice(Wire::wrap_slice(values))
            .send()
            .map_err(SendError::of)
    }

    fn loan(&self, length: usize) -> Option<Loan<T, H>> {
        self.make_room(length).ok()?;
        let slice = self.port.borrow().loan_slice_uninit(length).ok()?;
        Some(Loan(Box::new(slice.write_from_fn(|_| Wire(T::zeroed())))))
    }

    fn connect(&self) {
        // A host that cannot be connected now is connected next time.
        let _ = self.port.borrow().update_connections();
    }
}

impl<T, H> Held<T, H> for Sample<Ipc, [Wire<T>], Wire<H>>
where
    T: Pod + Debug,
    H: Pod + Debug,
{
    fn header(&self) -> &H {
        &self.user_header().0
    }

    fn values(&self) -> &[T] {
        Wire::peel_slice(self.payload())
    }
}

impl<T, H> Loaned<T, H> for SampleMut<Ipc, [Wire<T>], Wire<H>>
where
    T: Pod + Debug,
    H: Pod + Debug,
{
    fn parts(&mut self) -> (*mut H, *mut T) {
        let header: *mut H = &raw mut self.user_header_mut().0;
        (header, Wire::peel_slice_mut(self.payload_mut()).as_mut_ptr())
    }

    fn send(self: Box<Self>) -> Result<usize, SendError> {
        (*self).send().map_err(SendError::of)
    }
}

impl<T> Publisher<T> {
    pub(super) fn new(port: publisher::Publisher<Ipc, Wire<T>, ()>) -> Self
    where
        T: Pod + Debug,
    {
        Self(Box::new(port))
    }

    /// Sends to all connected programs; returns their number.
    pub fn send(&self, value: T) -> Result<usize, SendError> {
        self.0.send(value)
    }

    /// Connects new programs and drops those that left.
    pub fn connect(&self) {
        self.0.connect();
    }
}

impl<T> Subscriber<T> {
    pub(super) fn new(port: subscriber::Subscriber<Ipc, Wire<T>, ()>) -> Self
    where
        T: Pod + Debug,
    {
        Self(Box::new(move || {
            let sample = port.receive().ok().flatten()?;
            Some((sample.origin().value(), sample.0))
        }))
    }

    /// Returns the next value; `None` if there is none or it cannot be read.
    pub fn receive(&self) -> Option<T> {
        self.receive_from().map(|(_, value)| value)
    }

    /// As `receive`, with the number of the sending port, which no program can choose.
    pub fn receive_from(&self) -> Option<(u128, T)> {
        (self.0)()
    }
}

impl<T, H> SlicePublisher<T, H>
where
    T: Pod + Debug,
    H: Pod + Debug + Default,
{
    /// Uses `make` to make a port for slices of at most that many values.
    pub(super) fn new(
        length: usize,
        make: impl Fn(usize) -> Result<publisher::Publisher<Ipc, [Wire<T>], Wire<H>>, PublisherCreateError> + 'static,
    ) -> Result<Self, PublisherCreateError> {
        Ok(Self(Box::new(Growing {
            port: RefCell::new(make(length)?),
            length: Cell::new(length),
            make,
        })))
    }
}

impl<T, H> SlicePublisher<T, H> {
    /// Sends to all connected programs; returns their number.
    pub fn send(&self, header: &H, values: &[T]) -> Result<usize, SendError> {
        self.0.send(header, values)
    }

    /// Returns a slice of that length to fill in place; `None` if there is no room.
    pub fn loan(&self, length: usize) -> Option<Loan<T, H>> {
        self.0.loan(length)
    }

    /// Connects new programs and drops those that left.
    pub fn connect(&self) {
        self.0.connect();
    }
}

impl<T, H> SliceSubscriber<T, H> {
    pub(super) fn new(port: subscriber::Subscriber<Ipc, [Wire<T>], Wire<H>>) -> Self
    where
        T: Pod + Debug,
        H: Pod + Debug,
    {
        Self(Box::new(move || Some(Slice(Box::new(port.receive().ok().flatten()?)))))
    }

    /// Returns the next slice; `None` if there is none or it cannot be read.
    pub fn receive(&self) -> Option<Slice<T, H>> {
        (self.0)()
    }
}

impl<T, H> Slice<T, H> {
    /// Header of the slice.
    pub fn header(&self) -> &H {
        self.0.header()
    }

    /// Values of the slice.
    pub fn values(&self) -> &[T] {
        self.0.values()
    }
}

impl<T, H> Loan<T, H> {
    /// Returns pointers to header and values, for a thread that fills them while the loan stays here.
    pub fn parts(&mut self) -> (*mut H, *mut T) {
        self.0.parts()
    }

    /// Sends it to all connected programs; returns their number.
    pub fn send(self) -> Result<usize, SendError> {
        self.0.send()
    }
}

/// Numbers of subscribers and publishers of a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Connected {
    /// Number of subscribers.
    pub subscribers: usize,
    /// Number of publishers.
    pub publishers: usize,
}

impl From<&DynamicConfig<<Ipc as Service>::Bag>> for Connected {
    fn from(config: &DynamicConfig<<Ipc as Service>::Bag>) -> Self {
        Self {
            subscribers: config.number_of_subscribers(),
            publishers: config.number_of_publishers(),
        }
    }
}

/// Monitors the connections of a service.
pub struct Watch(Box<dyn Fn() -> Connected>);

impl Watch {
    pub(super) fn new(connected: impl Fn() -> Connected + 'static) -> Self {
        Self(Box::new(connected))
    }

    /// Returns the present connections.
    pub fn connected(&self) -> Connected {
        (self.0)()
    }
}
