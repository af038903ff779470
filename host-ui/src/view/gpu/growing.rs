//! Buffers on the graphics card that grow with their content.

use bytemuck::Pod;
use eframe::wgpu;
use std::mem::size_of;
use std::ops::Range;
use stylet_imaging::Gpu;

/// Buffer that grows by doubling and is otherwise reused.
pub struct Growing {
    pub buffer: wgpu::Buffer,
    usage: wgpu::BufferUsages,
    /// Number of valid elements, not bytes.
    pub len: u32,
}

impl Growing {
    pub fn new(device: &wgpu::Device, usage: wgpu::BufferUsages) -> Self {
        Self {
            buffer: allocate(device, usage, 1024),
            usage,
            len: 0,
        }
    }

    /// Writes the elements; returns the number of bytes sent.
    pub fn write<T: Pod>(&mut self, gpu: &Gpu, items: &[T]) -> u64 {
        let bytes: &[u8] = bytemuck::cast_slice(items);
        let size = bytes.len() as u64;
        if size > gpu.device.limits().max_buffer_size {
            // A scene that does not fit is not drawn; the rest of the window continues.
            self.len = 0;
            return 0;
        }
        if size > self.buffer.size() {
            self.buffer = allocate(&gpu.device, self.usage, size.next_power_of_two());
        }
        if size > 0 {
            gpu.queue.write_buffer(&self.buffer, 0, bytes);
        }
        self.len = items.len() as u32;
        size
    }

    /// Writes some elements into a buffer that has as many as were written last.
    pub fn write_run<T: Pod>(&mut self, gpu: &Gpu, items: &[T], run: Range<usize>) -> u64 {
        let part = items.get(run.clone()).unwrap_or_default();
        if items.len() != self.len as usize || part.is_empty() {
            return 0;
        }
        let bytes: &[u8] = bytemuck::cast_slice(part);
        gpu.queue
            .write_buffer(&self.buffer, (run.start * size_of::<T>()) as u64, bytes);
        bytes.len() as u64
    }
}

fn allocate(device: &wgpu::Device, usage: wgpu::BufferUsages, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("stylet view"),
        size,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}
