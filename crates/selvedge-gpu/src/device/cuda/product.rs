//! Matrix products by cuBLAS. It reads matrices column by column, so that each of our matrices is
//! its transpose there: the product is computed as cᵀ = bᵀ aᵀ, and nothing is moved.

use std::ffi::{c_int, c_void};

use cudarc::cublas::result::{self, CublasError};
use cudarc::cublas::sys::{self, cublasComputeType_t, cublasOperation_t, cudaDataType};

use super::context::alone;
use crate::device::{DeviceError, Precision};
use crate::schedule::{Matrix, Onto, Product};

/// Bytes of the workspace of cuBLAS: its default on the largest cards.
pub(super) const WORKSPACE: usize = 32 << 20;

/// A product as cuBLAS takes it. Pointers are offsets from the beginning of the arena, in elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gemm {
    /// Rows, columns and depth of cᵀ.
    pub(super) size: [c_int; 3],
    /// bᵀ: whether it is transposed, where it begins, from column to column.
    pub(super) left: (bool, usize, c_int),
    /// aᵀ.
    pub(super) right: (bool, usize, c_int),
    /// cᵀ.
    pub(super) out: (usize, c_int),
    /// The factor of the old values of c.
    pub(super) beta: f32,
}

impl Gemm {
    /// A product whose matrices begin at `first` words. None where a size is too large for cuBLAS.
    pub(super) fn of(product: &Product, first: impl Fn(&Matrix) -> usize) -> Option<Self> {
        let number = |size: usize| c_int::try_from(size).ok();
        let operand =
            |matrix: &Matrix| Some((matrix.transposed, first(matrix), number(matrix.leading)?));
        let [m, n, k] = product.size;
        Some(Self {
            size: [number(n)?, number(m)?, number(k)?],
            left: operand(&product.b)?,
            right: operand(&product.a)?,
            out: (first(&product.c), number(product.c.leading)?),
            beta: if product.onto == Onto::Add { 1.0 } else { 0.0 },
        })
    }
}

/// The major version of CUDA that cuBLAS belongs to: 12 of 12.9.
pub(super) fn major() -> Result<i32, DeviceError> {
    let mut major = 0;
    let what = sys::libraryPropertyType_t::MAJOR_VERSION;
    // SAFETY: it writes one integer.
    let asked = unsafe { sys::cublasGetProperty(what, &raw mut major) }.result();
    asked.map_err(failed("cublasGetProperty"))?;
    Ok(major)
}

/// cuBLAS on one stream.
pub(super) struct Blas {
    handle: sys::cublasHandle_t,
    compute: cublasComputeType_t,
}

fn failed(call: &'static str) -> impl Fn(CublasError) -> DeviceError {
    move |error| DeviceError::Call {
        call,
        reason: format!("{error}"),
    }
}

impl Blas {
    /// Products on `stream`, in `workspace`, which has [`WORKSPACE`] bytes.
    pub(super) fn new(
        stream: cudarc::driver::sys::CUstream,
        workspace: cudarc::driver::sys::CUdeviceptr,
        precision: Precision,
    ) -> Result<Self, DeviceError> {
        let guard = alone();
        let handle = result::create_handle().map_err(failed("cublasCreate"))?;
        drop(guard);
        let blas = Self {
            handle,
            compute: match precision {
                Precision::Full => cublasComputeType_t::CUBLAS_COMPUTE_32F,
                Precision::Tensor => cublasComputeType_t::CUBLAS_COMPUTE_32F_FAST_TF32,
            },
        };
        // SAFETY: one owner holds handle, stream and workspace. The stream is set first, since
        // setting it resets the workspace.
        unsafe {
            result::set_stream(handle, stream.cast()).map_err(failed("cublasSetStream"))?;
            sys::cublasSetWorkspace_v2(handle, workspace as *mut c_void, WORKSPACE)
                .result()
                .map_err(failed("cublasSetWorkspace"))?;
        }
        Ok(blas)
    }

    /// Multiplies, in the arena that begins at `arena`.
    pub(super) fn multiply(
        &self,
        gemm: &Gemm,
        arena: cudarc::driver::sys::CUdeviceptr,
    ) -> Result<(), DeviceError> {
        let [m, n, k] = gemm.size;
        let operation = |transposed: bool| {
            if transposed {
                cublasOperation_t::CUBLAS_OP_T
            } else {
                cublasOperation_t::CUBLAS_OP_N
            }
        };
        let kind = cudaDataType::CUDA_R_32F;
        let at = |number: usize| (arena + 4 * number as u64) as *const c_void;
        let ((left, a, lda), (right, b, ldb), (c, ldc)) = (gemm.left, gemm.right, gemm.out);
        let alpha = 1.0_f32;
        // SAFETY: the matrices lie in the arena, as was checked when the schedule was prepared. The
        // factors are read before the call returns.
        let done = unsafe {
            result::gemm_ex(
                self.handle,
                operation(left),
                operation(right),
                m,
                n,
                k,
                (&raw const alpha).cast(),
                at(a),
                kind,
                lda,
                at(b),
                kind,
                ldb,
                (&raw const gemm.beta).cast(),
                at(c).cast_mut(),
                kind,
                ldc,
                self.compute,
                sys::cublasGemmAlgo_t::CUBLAS_GEMM_DEFAULT,
            )
        };
        done.map_err(failed("cublasGemmEx"))
    }
}

impl Drop for Blas {
    fn drop(&mut self) {
        let _guard = alone();
        // SAFETY: it was created and not destroyed. A failure cannot be reported from here.
        let _ = unsafe { result::destroy_handle(self.handle) };
    }
}
