//! A graphics device, and operations common to all passes.

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
    "no graphics device can compute pictures: {0}; install a Vulkan driver, such as Mesa's in software (mesa-vulkan-drivers)"
)]
pub struct NoGpu(String);

impl Gpu {
    /// Creates a device without a window. `software` selects the driver that computes on the
    /// processor, which gives the same pictures on every machine.
    ///
    /// # Errors
    ///
    /// No Vulkan driver, or one that does not compute.
    pub fn headless(software: bool) -> Result<Self, NoGpu> {
        let mut asked = wgpu::InstanceDescriptor::new_without_display_handle();
        asked.backends = wgpu::Backends::VULKAN;
        let instance = wgpu::Instance::new(asked);
        let options = wgpu::RequestAdapterOptions {
            force_fallback_adapter: software,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(|e| NoGpu(e.to_string()))?;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("stylet imaging"),
            ..Default::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&descriptor)).map_err(|e| NoGpu(e.to_string()))?;
        Ok(Self { device, queue })
    }

    /// Returns whether it can compute; drivers of OpenGL may not.
    pub fn computes(&self) -> bool {
        self.device.limits().max_compute_workgroups_per_dimension > 0
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

    pub(crate) fn uniform(&self, bytes: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("stylet imaging"),
            size: bytes,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    pub(crate) fn texture(
        &self,
        dims: [u32; 3],
        dimension: wgpu::TextureDimension,
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("stylet imaging"),
            size: wgpu::Extent3d {
                width: dims[0],
                height: dims[1],
                depth_or_array_layers: dims[2],
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension,
            format,
            usage,
            view_formats: &[],
        })
    }

    pub(crate) fn write(&self, texture: &wgpu::Texture, bytes: &[u8], bytes_per_texel: u32) {
        let size = texture.size();
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size.width * bytes_per_texel),
            rows_per_image: Some(size.height),
        };
        self.queue.write_texture(texture.as_image_copy(), bytes, layout, size);
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

    pub(crate) fn layout(&self, visibility: wgpu::ShaderStages, types: &[wgpu::BindingType]) -> wgpu::BindGroupLayout {
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

    pub(crate) fn bind(&self, layout: &wgpu::BindGroupLayout, bound: &[wgpu::BindingResource<'_>]) -> wgpu::BindGroup {
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

    /// Creates a sampler, linear between texels and constant beyond the outermost.
    pub(crate) fn clamped(&self) -> wgpu::Sampler {
        self.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("stylet imaging"),
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

/// Bindings of a uniform, a buffer that is read, and one that is written.
pub(crate) const UNIFORM: wgpu::BindingType = buffer(wgpu::BufferBindingType::Uniform);
pub(crate) const READ: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: true });
pub(crate) const WRITE: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: false });
/// Binding of a volume, and of its sampler.
pub(crate) const VOLUME: wgpu::BindingType = wgpu::BindingType::Texture {
    sample_type: wgpu::TextureSampleType::Float { filterable: true },
    view_dimension: wgpu::TextureViewDimension::D3,
    multisampled: false,
};
pub(crate) const SAMPLER: wgpu::BindingType = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
/// Usage of a texture that is filled from here and read by passes.
pub(crate) const FILLED: wgpu::TextureUsages =
    wgpu::TextureUsages::TEXTURE_BINDING.union(wgpu::TextureUsages::COPY_DST);
/// Binding of numbers by column and row, read one by one.
pub(crate) const GRID: wgpu::BindingType = wgpu::BindingType::Texture {
    sample_type: wgpu::TextureSampleType::Float { filterable: false },
    view_dimension: wgpu::TextureViewDimension::D2,
    multisampled: false,
};

const fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer {
        ty,
        has_dynamic_offset: false,
        min_binding_size: None,
    }
}

/// Entry point of a shader, with the values of its constants.
pub type Stage<'a> = (&'a str, &'a [(&'a str, f64)]);

/// Pipeline whose vertices are made by its own shader.
pub struct Drawing<'a> {
    /// Name in messages of the driver.
    pub label: &'a str,
    /// Source of both shaders.
    pub wgsl: &'a str,
    /// Vertex shader.
    pub vertex: Stage<'a>,
    /// Fragment shader.
    pub fragment: Stage<'a>,
    /// Format of the picture.
    pub target: wgpu::TextureFormat,
}

impl Drawing<'_> {
    /// Creates the pipeline for bindings of this layout.
    pub fn pipeline(&self, device: &wgpu::Device, layout: &wgpu::BindGroupLayout) -> wgpu::RenderPipeline {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(self.label),
            source: wgpu::ShaderSource::Wgsl(self.wgsl.into()),
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(self.label),
            bind_group_layouts: &[Some(layout)],
            immediate_size: 0,
        });
        let options = |(_, constants)| wgpu::PipelineCompilationOptions {
            constants,
            ..Default::default()
        };
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(self.label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(self.vertex.0),
                compilation_options: options(self.vertex),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(self.fragment.0),
                compilation_options: options(self.fragment),
                targets: &[Some(self.target.into())],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}
