// A model: a trained network.
using System;

namespace Selvedge
{
    /// <summary>A model. Steppers that were made of it go on after it is disposed of.</summary>
    public sealed class Model : IDisposable
    {
        private ulong handle;

        /// <summary>Opens a model by the path of its file or the name of a shipped one; null is
        /// the one that the command line takes.</summary>
        /// <exception cref="SelvedgeException">Says what of the model is wrong.</exception>
        public Model(string pathOrName = null)
        {
            Native.CheckInterface();
            Native.Check(Native.selvedge_model_open(Native.Bytes(pathOrName), out handle));
        }

        /// <summary>Frees a model that nobody disposed of.</summary>
        ~Model()
        {
            Free();
        }

        internal ulong Handle
        {
            get { return handle; }
        }

        /// <summary>Frees the model.</summary>
        public void Dispose()
        {
            Free();
            GC.SuppressFinalize(this);
        }

        private void Free()
        {
            if (handle != 0) Native.selvedge_model_free(handle);
        }
    }
}
