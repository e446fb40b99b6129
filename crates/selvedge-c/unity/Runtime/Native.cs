// The functions of selvedge.h, as they are. Scene, Model and Stepper are the classes around them.
using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Selvedge
{
    /// <summary>Outcome of a call.</summary>
    public enum Status
    {
        Ok = 0,
        Argument = 1,
        Count = 2,
        Handle = 3,
        Freed = 4,
        Poisoned = 5,
        Open = 6,
        Start = 7,
        Step = 8,
        Stopped = 9,
        Panic = 10,
    }

    /// <summary>Correction of frames that no cloth could have; Limit is that of the command
    /// line.</summary>
    public enum Guard
    {
        Limit = 0,
        None = 1,
    }

    /// <summary>Judgement of a frame.</summary>
    public enum Verdict
    {
        Held = 0,
        Corrected = 1,
        Lost = 2,
    }

    /// <summary>Origin of the frame that replaced a lost one.</summary>
    public enum Replacement
    {
        Nothing = 0,
        Physics = 1,
        Carry = 2,
    }

    /// <summary>Contact on the way to a frame.</summary>
    public enum Contact
    {
        Free = 0,
        Pushed = 1,
        Lost = 2,
    }

    /// <summary>Counts of a stepper, as SelvedgeCounts.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Counts
    {
        public ulong Vertices;
        public ulong Faces;
        public ulong Handles;
        /// <summary>Targets per frame with which the command line drives such a
        /// stepper.</summary>
        public ulong Samples;
        public ulong MotionFrames;
        public ulong Frame;
        /// <summary>Frames per second.</summary>
        public double FrameRate;
    }

    /// <summary>Word of the guard on the newest frame, as SelvedgeTrust.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Trust
    {
        public ulong Frame;
        public Verdict Verdict;
        public Replacement ReplacedBy;
        public Contact Contact;
        public int PhysicsFailed;
        public double LargestStrain;
        public double SmallestStrain;
        public double StrainRms;
        public double KineticEnergy;
        public double LargestSpeed;
        public double PredictedStrain;
        public double CorrectionRms;
        public double CorrectionLargest;
    }

    /// <summary>Names the function that C calls, for compilers ahead of time.</summary>
    [AttributeUsage(AttributeTargets.Method)]
    internal sealed class MonoPInvokeCallbackAttribute : Attribute
    {
        public MonoPInvokeCallbackAttribute(Type type)
        {
            Type = type;
        }

        public Type Type { get; }
    }

    /// <summary>The functions of the library.</summary>
    internal static class Native
    {
        /// <summary>Number of the interface that these declarations are of.</summary>
        internal const uint Interface = 1;

        private const string Library = "selvedge_c";
        private const CallingConvention C = CallingConvention.Cdecl;

        [UnmanagedFunctionPointer(C)]
        internal delegate int Hear(IntPtr context, IntPtr task, ulong done, ulong goal);

        [StructLayout(LayoutKind.Sequential)]
        internal struct Listener
        {
            internal IntPtr Hear;
            internal IntPtr Context;
        }

        [DllImport(Library, CallingConvention = C)]
        internal static extern uint selvedge_interface();

        [DllImport(Library, CallingConvention = C)]
        internal static extern IntPtr selvedge_version();

        [DllImport(Library, CallingConvention = C)]
        internal static extern IntPtr selvedge_last_error();

        [DllImport(Library, CallingConvention = C)]
        internal static extern IntPtr selvedge_status_text(int status);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_set_threads(UIntPtr threads);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_keep_rest_poses(byte[] folder);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_scene_open(byte[] pathOrName, out ulong scene);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_scene_warnings(
            ulong scene, byte[] text, UIntPtr room, out UIntPtr needed);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_scene_free(ulong scene);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_model_open(byte[] pathOrName, out ulong model);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_model_free(ulong model);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_physics(
            ulong scene, ref Listener listener, out ulong stepper);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_model(
            ulong scene, ulong model, int guard, ref Listener listener, out ulong stepper);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_step(
            ulong stepper, double[] targets, UIntPtr samples, UIntPtr handles, byte[] released);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_step_along(ulong stepper);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_motion_targets(
            ulong stepper, double[] targets, UIntPtr samples, UIntPtr handles, byte[] released);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_stop(ulong stepper, int wanted);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_free(ulong stepper);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_snapshot(ulong stepper, out ulong snapshot);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_restore(ulong stepper, ulong snapshot);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_reset(ulong stepper);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_lead_body(
            ulong stepper, UIntPtr body, double[] matrix);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_teleport(
            ulong stepper, double[] matrix, UIntPtr[] bodies, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_snapshot_free(ulong snapshot);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_counts(ulong stepper, out Counts counts);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_positions(
            ulong stepper, out IntPtr positions, out UIntPtr vertices);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_copy_positions(
            ulong stepper, float[] positions, UIntPtr vertices);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_copy_positions_f64(
            ulong stepper, double[] positions, UIntPtr vertices);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_copy_impulses(
            ulong stepper, double[] impulses, UIntPtr bodies);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_copy_faces(
            ulong stepper, uint[] faces, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_copy_handles(
            ulong stepper, uint[] handles, UIntPtr count);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_trust(ulong stepper, out Trust trust);

        [DllImport(Library, CallingConvention = C)]
        internal static extern Status selvedge_stepper_warnings(
            ulong stepper, byte[] text, UIntPtr room, out UIntPtr needed);

        /// <summary>Throws where a call failed, with the library's words.</summary>
        internal static void Check(Status status)
        {
            if (status != Status.Ok)
                throw new SelvedgeException(status, Text(selvedge_last_error()));
        }

        /// <summary>Refuses a library with another interface.</summary>
        internal static void CheckInterface()
        {
            uint found = selvedge_interface();
            if (found != Interface)
                throw new SelvedgeException(
                    Status.Argument,
                    "the library has interface " + found + ", and these classes are of " + Interface
                        + ": take both from one version");
        }

        /// <summary>UTF-8 with a zero byte at its end; null for null.</summary>
        internal static byte[] Bytes(string text)
        {
            return text == null ? null : Encoding.UTF8.GetBytes(text + "\0");
        }

        /// <summary>Reads UTF-8 up to a zero byte.</summary>
        internal static string Text(IntPtr text)
        {
            int length = 0;
            while (Marshal.ReadByte(text, length) != 0) length++;
            var bytes = new byte[length];
            Marshal.Copy(text, bytes, 0, length);
            return Encoding.UTF8.GetString(bytes);
        }

        internal delegate Status Writer(byte[] text, UIntPtr room, out UIntPtr needed);

        /// <summary>Lines of a text that the library writes.</summary>
        internal static string[] Lines(Writer write)
        {
            UIntPtr needed, again;
            Check(write(null, UIntPtr.Zero, out needed));
            var bytes = new byte[(int)needed];
            Check(write(bytes, needed, out again));
            string text = Encoding.UTF8.GetString(bytes, 0, bytes.Length - 1);
            return text.Length == 0 ? new string[0] : text.Split('\n');
        }
    }
}
