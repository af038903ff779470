//! A graphics device, and operations common to all passes.

use std::error::Error;
use wgpu::util::DeviceExt;

/// A device and its queue.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
}

/// No device can compute pictures here.
#[derive(Debug, thiserror::Error)]
#[error(
    "no graphics device can compute pictures: {why}; install a Vulkan driver, such as Mesa's in software (mesa-vulkan-drivers)"
)]
pub struct NoGpu {
    /// Error of the adapter or of its device.
    #[source]
    why: Box<dyn Error + Send + Sync>,
}

#[cfg(not(target_family = "wasm"))]
impl NoGpu {
    fn of(why: impl Error + Send + Sync + 'static) -> Self {
        Self { why: Box::new(why) }
    }
}

impl Gpu {
    /// Creates a device without a window. `software` selects the driver that computes on the
    /// processor, which gives the same pictures on every machine.
    ///
    /// # Errors
    ///
    /// No Vulkan driver, or one that does not compute.
    #[cfg(not(target_family = "wasm"))]
    pub fn headless(software: bool) -> Result<Self, NoGpu> {
        let mut asked = wgpu::InstanceDescriptor::new_without_display_handle();
        asked.backends = wgpu::Backends::VULKAN;
        let instance = wgpu::Instance::new(asked);
        let options = wgpu::RequestAdapterOptions {
            force_fallback_adapter: software,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(NoGpu::of)?;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("stylet imaging"),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).map_err(NoGpu::of)?;
        Ok(Self { device, queue })
    }

    /// Returns whether it can compute; drivers of OpenGL may not. A web page gets results only between its frames, and
    /// the passes wait for them.
    pub fn computes(&self) -> bool {
        !cfg!(target_family = "wasm") && self.device.limits().max_compute_workgroups_per_dimension > 0
    }

    pub(crate) fn storage(&self, bytes: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("stylet imaging"),
            size: bytes.max(16),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        })
    }

    pub(crate) fn filled(&self, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("stylet imaging"),
            contents: bytes,
            usage: usage | wgpu::BufferUsages::COPY_DST,
        })
    }

    /// Creates a buffer for the uniforms of a pass.
    pub fn uniform(&self, bytes: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("stylet imaging"),
            size: bytes,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Creates a volume that is filled from here and read by passes.
    pub fn volume(&self, dims: [u32; 3], format: wgpu::TextureFormat) -> wgpu::Texture {
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        self.texture(dims, wgpu::TextureDimension::D3, 1, format, usage)
    }

    /// Creates a picture with this number of samples per pixel.
    pub fn picture(
        &self,
        [width, height]: [u32; 2],
        samples: u32,
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        let dimension = wgpu::TextureDimension::D2;
        self.texture([width, height, 1], dimension, samples, format, usage)
    }

    fn texture(
        &self,
        [width, height, depth_or_array_layers]: [u32; 3],
        dimension: wgpu::TextureDimension,
        sample_count: u32,
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("stylet imaging"),
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers,
            },
            mip_level_count: 1,
            sample_count,
            dimension,
            format,
            usage,
            view_formats: &[],
        })
    }

    /// Fills a texture; returns the number of bytes sent.
    pub fn write(&self, texture: &wgpu::Texture, bytes: &[u8], bytes_per_texel: u32) -> u64 {
        let size = texture.size();
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size.width * bytes_per_texel),
            rows_per_image: Some(size.height),
        };
        self.queue.write_texture(texture.as_image_copy(), bytes, layout, size);
        bytes.len() as u64
    }

    /// Returns the content of a buffer, once the earlier passes are done.
    pub(crate) fn read<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer) -> Vec<T> {
        let size = buffer.size();
        let near = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("stylet imaging, read"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &near, 0, size);
        self.queue.submit([encoder.finish()]);
        self.mapped(&near)
    }

    /// Returns the texels of a texture of four bytes each, row by row.
    pub(crate) fn pixels<T: bytemuck::Pod>(&self, texture: &wgpu::Texture) -> Vec<T> {
        let size = texture.size();
        let row = (size.width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let near = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("stylet imaging, read"),
            size: u64::from(row * size.height),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let to = wgpu::TexelCopyBufferInfo {
            buffer: &near,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(row),
                rows_per_image: Some(size.height),
            },
        };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), to, size);
        self.queue.submit([encoder.finish()]);
        let texels: Vec<T> = self.mapped(&near);
        let rows = texels.chunks_exact(row as usize / 4);
        rows.flat_map(|row| row[..size.width as usize].to_vec()).collect()
    }

    /// Creates the layout of bindings in this order.
    pub fn layout(&self, visibility: wgpu::ShaderStages, types: &[wgpu::BindingType]) -> wgpu::BindGroupLayout {
        let entries: Vec<wgpu::BindGroupLayoutEntry> = (0..)
            .zip(types)
            .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility,
                ty: *ty,
                count: None,
            })
            .collect();
        self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("stylet imaging"),
            entries: &entries,
        })
    }

    /// Binds resources in this order.
    pub fn bind(&self, layout: &wgpu::BindGroupLayout, bound: &[wgpu::BindingResource<'_>]) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
            .zip(bound)
            .map(|(binding, resource)| wgpu::BindGroupEntry {
                binding,
                resource: resource.clone(),
            })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("stylet imaging"),
            layout,
            entries: &entries,
        })
    }

    /// Creates pipelines for these passes of one module.
    pub(crate) fn compute<const N: usize>(
        &self,
        layout: &wgpu::BindGroupLayout,
        source: &str,
        entries: [&str; N],
        constants: &[(&str, f64)],
    ) -> [wgpu::ComputePipeline; N] {
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("stylet imaging"),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("stylet imaging"),
            bind_group_layouts: &[Some(layout)],
            immediate_size: 0,
        });
        entries.map(|entry| {
            self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants,
                    ..Default::default()
                },
                cache: None,
            })
        })
    }

    /// Creates a sampler, linear between texels.
    pub fn sampler(&self, beyond: wgpu::AddressMode) -> wgpu::Sampler {
        self.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("stylet imaging"),
            address_mode_u: beyond,
            address_mode_v: beyond,
            address_mode_w: beyond,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        })
    }

    fn mapped<T: bytemuck::Pod>(&self, near: &wgpu::Buffer) -> Vec<T> {
        near.map_async(wgpu::MapMode::Read, .., |_| ());
        // A lost device gives no pixels; a picture without any is drawn black.
        if self.device.poll(wgpu::PollType::wait_indefinitely()).is_err() {
            return Vec::new();
        }
        let bytes = near.get_mapped_range(..);
        bytes.map_or_else(|_| Vec::new(), |view| bytemuck::pod_collect_to_vec(&view))
    }
}

/// Returns the attachment of a pass that draws all of a picture.
pub fn drawn_on(
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<wgpu::Color>,
) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load,
            store: wgpu::StoreOp::Store,
        },
    })
}

/// Binding of a uniform.
pub const UNIFORM: wgpu::BindingType = buffer(wgpu::BufferBindingType::Uniform);
/// Bindings of a buffer that is read, and of one that is written.
pub(crate) const READ: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: true });
pub(crate) const WRITE: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: false });
/// Binding of a volume.
pub const VOLUME: wgpu::BindingType = texture(wgpu::TextureViewDimension::D3, true);
/// Binding of a picture.
pub const PICTURE: wgpu::BindingType = texture(wgpu::TextureViewDimension::D2, true);
/// Binding of numbers by column and row, read one by one.
pub(crate) const GRID: wgpu::BindingType = texture(wgpu::TextureViewDimension::D2, false);
/// Binding of the sampler of a volume or a picture.
pub const SAMPLER: wgpu::BindingType = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);

const fn texture(view_dimension: wgpu::TextureViewDimension, filterable: bool) -> wgpu::BindingType {
    wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable },
        view_dimension,
        multisampled: false,
    }
}

const fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer {
        ty,
        has_dynamic_offset: false,
        min_binding_size: None,
    }
}

/// Entry point of a shader, with the values of its constants.
pub type Stage<'a> = (&'a str, &'a [(&'a str, f64)]);

/// Pipeline that draws.
pub struct Drawing<'a> {
    /// Source of both shaders.
    pub wgsl: &'a str,
    /// Vertex shader.
    pub vertex: Stage<'a>,
    /// Fragment shader.
    pub fragment: Stage<'a>,
    /// Format of the picture, and its blending.
    pub target: wgpu::ColorTargetState,
    /// Vertices; none if the shader makes its own.
    pub buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    /// Shape and culling.
    pub primitive: wgpu::PrimitiveState,
    /// Depth of the picture.
    pub depth: Option<wgpu::DepthStencilState>,
    /// Samples per pixel.
    pub samples: u32,
}

impl<'a> Drawing<'a> {
    /// Returns triangles whose vertices are made by their own shader.
    pub fn made_by_shader(wgsl: &'a str, vertex: Stage<'a>, fragment: Stage<'a>, target: wgpu::TextureFormat) -> Self {
        Self {
            wgsl,
            vertex,
            fragment,
            target: target.into(),
            buffers: &[],
            primitive: Default::default(),
            depth: None,
            samples: 1,
        }
    }

    /// Creates the pipeline for bindings of this layout.
    pub fn pipeline(self, device: &wgpu::Device, layout: &wgpu::BindGroupLayout) -> wgpu::RenderPipeline {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(self.fragment.0),
            source: wgpu::ShaderSource::Wgsl(self.wgsl.into()),
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(self.fragment.0),
            bind_group_layouts: &[Some(layout)],
            immediate_size: 0,
        });
        let options = |(_, constants)| wgpu::PipelineCompilationOptions {
            constants,
            ..Default::default()
        };
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(self.fragment.0),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(self.vertex.0),
                compilation_options: options(self.vertex),
                buffers: self.buffers,
            },
            primitive: self.primitive,
            depth_stencil: self.depth,
            multisample: wgpu::MultisampleState {
                count: self.samples,
                ..Default::default()
            },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(self.fragment.0),
                compilation_options: options(self.fragment),
                targets: &[Some(self.target)],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}
